"""How fast `evimo annotate` is, and how much memory it takes: EV-IMO's three scans in a room of a million points.

    python bench/annotate_speed.py ../shared/data --frames 400
    python bench/annotate_speed.py ../shared/data --frames 12000 --minutes 60  # a whole part of an hour

The camera is EV-IMO's (346x260); it and the objects wander before the wall. Poses come at 200 Hz.
"""

import argparse
import resource
import tempfile
import time
from pathlib import Path

import numpy as np
import trimesh
import yaml
from scipy.spatial.transform import Rotation

from evimo.annotate.annotation import Annotation, Instants
from evimo.captures.capture import open_capture

DRAWN = 400  # frames at most that are drawn and not written
SCANS = ("toy_car", "toy_plane", "cup")
FACES = (  # of a room of 6 x 5 x 3 m and a cupboard: a corner and two sides
    ((-3, -2.5, 0), (6, 0, 0), (0, 5, 0)), ((-3, -2.5, 3), (6, 0, 0), (0, 5, 0)), ((-3, -2.5, 0), (6, 0, 0), (0, 0, 3)),
    ((-3, 2.5, 0), (6, 0, 0), (0, 0, 3)), ((-3, -2.5, 0), (0, 5, 0), (0, 0, 3)), ((3, -2.5, 0), (0, 5, 0), (0, 0, 3)),
    ((1.5, -1, 0), (0, 0.8, 0), (0, 0, 1.2)), ((1.5, -1, 1.2), (0.8, 0, 0), (0, 0.8, 0)),
)  # fmt: skip


def room(count: int) -> np.ndarray:
    """Points strewn over the faces, with a millimetre of noise."""
    rng = np.random.default_rng(0)
    areas = np.array([np.linalg.norm(np.cross(one, other)) for _, one, other in FACES])
    pieces = [
        np.array(corner) + rng.random((number, 1)) * np.array(one) + rng.random((number, 1)) * np.array(other)
        for (corner, one, other), number in zip(FACES, np.rint(areas / areas.sum() * count).astype(int), strict=True)
    ]
    return np.concatenate(pieces) + rng.normal(scale=1e-3, size=(sum(map(len, pieces)), 3))


def wander(t_s: np.ndarray, place: tuple[float, float, float], start: np.ndarray, seed: int) -> np.ndarray:
    """Poses (M, 7) that swing by 0.2 m and 20 degrees about a place."""
    phase = np.random.default_rng(seed).uniform(0, 6, 6)
    swing = np.sin(t_s[:, None] * np.array([2.1, 1.7, 2.9, 3.1, 2.3, 1.9]) + phase)
    turned = Rotation.from_matrix(start) * Rotation.from_rotvec(0.35 * swing[:, 3:])
    return np.concatenate((np.array(place) + 0.2 * swing[:, :3], turned.as_quat()), axis=1)


def write_capture(folder: Path, data: Path, seconds: float, points: int) -> None:
    """A capture of so many seconds in a folder."""
    t_s = np.arange(0, seconds + 0.1, 0.005)
    ahead = np.array([[0, 0, 1.0], [-1, 0, 0], [0, -1, 0]])  # looks along x
    bodies = {"Rig": wander(t_s, (-1.0, 0, 1.3), ahead, 0)}
    bodies |= {name: wander(t_s, (0.0, 0.35 * (k - 1), 1.3), np.eye(3), k + 1) for k, name in enumerate(SCANS)}
    for body, poses in bodies.items():
        np.savetxt(folder / f"{body}.txt", np.column_stack((t_s, poses)), fmt="%.7f")
    trimesh.PointCloud(room(points)).export(folder / "room.ply")
    t_us = np.linspace(0, seconds * 1e6 - 1, 5000).astype(int)
    (folder / "events.txt").write_text("\n".join(f"{t} {t % 346} {t % 260} {t % 2}" for t in t_us.tolist()))
    still = {"position": [0, 0, 0], "quaternion": [0, 0, 0, 1]}
    scans = {
        name: {"id": k, "body": name, "scan": str((data / "scans" / name).resolve()), "body_from_scan": still}
        for k, name in enumerate(SCANS, 1)
    }
    lens = str((data / "calibration" / "evimo1_calib.yaml").resolve())
    settings = {
        "recording": {"file": "events.txt", "sensor": "346x260", "time_unit": "us"},
        "mocap": {"files": [f"{body}.txt" for body in bodies]},
        "camera": {"body": "Rig", "intrinsics": lens, "body_from_cam": still},
        "objects": scans,
        "room": {"scan": "room.ply"},
    }
    (folder / "capture.yaml").write_text(yaml.safe_dump(settings))


def peak_mib() -> float:
    """The most memory that this process has had, MiB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    """Measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path, help="the shared folder of real data")
    parser.add_argument("--frames", type=int, default=400)
    parser.add_argument(
        "--minutes", type=float, default=0.0, help="of the capture; as long as the frames take by default"
    )
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--threads", type=int, default=2)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_capture(folder, asked.data, max(asked.minutes * 60, asked.frames / 200), asked.points)
        print(f"written, peak {peak_mib():.0f} MiB")
        annotation = Annotation(open_capture(folder), Instants(200.0), threads=asked.threads)
        start = time.process_time()
        _, lens = annotation.scene, annotation.camera  # read
        print(f"poses and scans loaded in {time.process_time() - start:.1f} s of CPU, peak {peak_mib():.0f} MiB")
        times_us = annotation.times(0)[: asked.frames]
        list(annotation.truths(times_us[:2]))  # compiles
        clocks = time.perf_counter(), time.process_time()
        covered = [float((truth.ids > 0).mean()) for truth in annotation.truths(times_us[:DRAWN])]
        wall, cpu = time.perf_counter() - clocks[0], time.process_time() - clocks[1]
        print(f"drawn: {len(covered)} frames of {lens.size}, {np.mean(covered):.1%} of pixels objects")
        print(f"  {len(covered) / wall:.0f} frames/s, {1e3 * cpu / len(covered):.2f} ms of CPU per frame")
        clocks = time.perf_counter(), time.process_time()
        written = 0
        for written in annotation.write(folder / "out", 0):
            if written == len(times_us) < len(annotation.times(0)):
                break
        wall, cpu = time.perf_counter() - clocks[0], time.process_time() - clocks[1]
        print(f"drawn and written: {written / wall:.0f} frames/s, {1e3 * cpu / written:.2f} ms of CPU per frame")
        print(f"peak {peak_mib():.0f} MiB")


if __name__ == "__main__":
    main()
