"""A whole capture of a flickering wand, its events made one by one, is calibrated by the command."""

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from evimo.calibrating.event_images import count_images
from evimo.calibrating.rigid import angle_between, moved
from evimo.captures.capture import open_capture
from evimo.cli import main
from evimo.events.events import Events

SECONDS = 8.0


def flicker(known, rng, hertz=250.0):
    """Events of the pixels under each light whenever it goes on or off, and stray ones."""
    period_us = 5e5 / hertz
    times_us = np.arange(1e5, SECONDS * 1e6, period_us)
    cam_from_lights = known.cam_from_wand(times_us)
    columns = []
    for light in known.lights:
        px = known.pixels(moved(cam_from_lights, light[None, None])[:, 0])
        spread = px[:, None] + rng.normal(0, 0.8, (len(px), 10, 2))
        t = np.repeat(times_us, 10) + rng.uniform(0, 300, 10 * len(px))
        p = np.repeat(np.where(np.arange(len(px)) % 2, 1, -1), 10)
        columns.append(np.column_stack((spread.reshape(-1, 2), t, p)))
    stray = np.column_stack(
        (rng.uniform(0, 345, 4000), rng.uniform(0, 259, 4000), rng.uniform(1e5, SECONDS * 1e6, 4000), np.ones(4000))
    )
    x, y, t, p = np.concatenate((*columns, stray)).T
    x, y = np.rint(x), np.rint(y)
    kept = (x >= 0) & (y >= 0) & (x < known.camera.width) & (y < known.camera.height)
    order = np.flatnonzero(kept)[np.argsort(t[kept], kind="stable")]
    kinds = zip((x, y, t, p), ("u2", "u2", "i8", "i1"), strict=True)
    return Events(*(each[order].astype(kind) for each, kind in kinds))


def mocap_csv(known, rng):
    """Poses and markers at 200 Hz in mocap's own clock, with noise and losses."""
    t_s = np.arange(0, SECONDS, 0.005)
    poses = ["t_us,body,x,y,z,qx,qy,qz,qw"]
    for body, path in (("Rig", known.world_from_rig), ("Wand", known.world_from_wand)):
        there = path(t_s)
        place = there[:, :3, 3] + rng.normal(0, 1e-4, (len(t_s), 3))
        numbers = np.concatenate((place, Rotation.from_matrix(there[:, :3, :3]).as_quat()), axis=1)
        lost = rng.random(len(t_s)) < 0.03
        for at, row, gone in zip(np.rint(1e6 * t_s).astype(int), numbers, lost, strict=True):
            poses.append(f"{at},{body}," + ",".join("" if gone else f"{value:.9f}" for value in row))
    markers = ["t_us,body,marker,x,y,z"]
    there = known.world_from_wand(t_s[::20]) @ known.body_from_wand
    for name, light in zip("BADEC", known.lights[[1, 0, 3, 4, 2]], strict=True):
        for at, place in zip(np.rint(1e6 * t_s[::20]).astype(int), moved(there, light[None, None])[:, 0], strict=True):
            markers.append(f"{at},Wand,{name}," + ",".join(f"{value:.9f}" for value in place))
    return "\n".join(poses), "\n".join(markers)


def test_a_capture_of_a_wand_is_calibrated(known, tmp_path, capsys):
    rng = np.random.default_rng(12)
    events = flicker(known, rng)
    np.savez(tmp_path / "events.npz", x=events.x, y=events.y, t=events.t, p=events.p)
    poses, markers = mocap_csv(known, rng)
    (tmp_path / "mocap.csv").write_text(poses)
    (tmp_path / "markers.csv").write_text(markers)
    lens = {name: getattr(known.camera, name) for name in ("fx", "fy", "cx", "cy", "height", "width")}
    settings = {
        "recording": {"file": "events.npz", "sensor": "346x260", "time_unit": "us"},
        "mocap": {"files": ["mocap.csv"], "markers": ["markers.csv"]},
        "camera": {"body": "Rig", "intrinsics": lens | {"distortion": list(known.camera.distortion)}},
    }
    (tmp_path / "capture.yaml").write_text(yaml.safe_dump(settings))
    lights = {str(number): light.tolist() for number, light in enumerate(known.lights)}
    target = {"kind": "wand", "body": "Wand", "lights": lights, "markers": lights}
    (tmp_path / "wand.yaml").write_text(yaml.safe_dump(target))
    assert main(["calibrate", str(tmp_path), "--target", str(tmp_path / "wand.yaml")]) == 0
    assert "add it to `calibration" in capsys.readouterr().out
    (tmp_path / "capture.yaml").write_text(yaml.safe_dump(settings | {"calibration": ["calibration.yaml"]}))
    found = open_capture(tmp_path)
    assert np.linalg.norm(found.camera.body_from_cam[:3, 3] - known.rig_from_cam[:3, 3]) < 0.001
    assert np.degrees(angle_between(found.camera.body_from_cam, known.rig_from_cam)) < 0.05
    assert abs(found.offset_us - known.offset_us) < 200


def test_windows_do_not_depend_on_packets_and_gaps_cost_nothing():
    t = np.concatenate((np.arange(0, 1000, 10), np.arange(10**12, 10**12 + 1000, 10)))
    events = Events(np.full(200, 3, "u2"), np.full(200, 2, "u2"), t, np.ones(200, "i1"))

    def windows(size):
        columns = (events.x, events.y, events.t, events.p)
        packets = (Events(*(each[at : at + size] for each in columns)) for at in range(0, 200, size))
        images = count_images(packets, (4, 5), window_us=100, every_us=300)
        return [(time_us, counts[2, 3]) for time_us, counts in images]

    assert windows(200) == windows(7) == windows(1)
    assert windows(200)[:3] == [(45.0, 10.0), (345.0, 10.0), (645.0, 10.0)]
