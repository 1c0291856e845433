"""Frames per second of the renderer beside Embree, which casts the same rays at the same scenes as triangles.

    python bench/rendering.py

In turn, in CPU time, one thread each. The renderer does more per frame: it shades, and casts four more rays in pixels
at edges. Embree says only what each ray meets; its tree over all triangles is built anew for each frame, as things
move, which is counted apart.
Boxes, cylinders and nets as triangles are exact or nearly so, ellipsoids have 1280: the notes say in how many pixels
both see the same depth to 1 %.
"""

import statistics
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from evimo.scene.bodies import BOX, CYLINDER, ELLIPSOID, GRATING, Part, Scene
from evimo.scene.meshes.bank import MeshBank
from evimo.scene.renderer import Renderer
from evimo.simulate.own_folders import OwnFolders
from evimo.simulate.plan import RecordingPlan
from evimo.simulate.recording import simulate_recording

F8 = NDArray[np.float64]
SIZE = (260, 346)
SEED = 90_000
SETS = (1, 2, 3, 4, 5, 6)
SECONDS = 0.5
FRAMES = 8  # of each scene, spread over its time
ROUNDS = 5
ROUND = 64  # sides of a cylinder
BALL = 3  # times a ball's 20 triangles are each cut in four


def rendering_rows() -> Iterator[dict[str, Any]]:
    """Both rates, over all scenes without and with meshes; Embree's only where embreex is installed."""
    before = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        with TemporaryDirectory() as folder:
            write_meshes(Path(folder))
            for kind, own in (("", OwnFolders()), ("_meshes", OwnFolders(meshes=Path(folder)))):
                films = (
                    simulate_recording(RecordingPlan(seed=SEED + k, set_number=k, seconds=SECONDS, size=SIZE, own=own))
                    for k in SETS
                )
                yield from _rows([Renderer(film.scene, film.camera) for film in films], kind)
    finally:
        numba.set_num_threads(before)


def write_meshes(folder: Path) -> None:
    """Two things with 16,000 and 20,000 triangles."""
    import trimesh

    trimesh.creation.torus(1, 0.4, major_sections=128, minor_sections=64).export(folder / "ring.ply")
    ball = trimesh.creation.icosphere(5)
    x, y, z = ball.vertices.T
    ball.vertices *= (1 + 0.2 * np.sin(5 * x) * np.sin(6 * y) * np.sin(7 * z))[:, None]
    ball.export(folder / "stone.ply")


def _rows(renderers: list[Renderer], kind: str) -> Iterator[dict[str, Any]]:
    times, peer = np.linspace(0.1, 0.9, FRAMES) * SECONDS, find_spec("embreex") is not None
    ours: list[float] = []
    embree: list[tuple[float, float, float]] = []
    for renderer in renderers:
        renderer.frames(times[:1])
    for _ in range(ROUNDS):
        spent = [_timed(lambda r=r: r.frames(times)) for r in renderers]
        ours.append(len(spent) * FRAMES / sum(spent))
        if peer:
            each = [embree_frame(renderer, time_s) for renderer in renderers for time_s in times[:: FRAMES // 2]]
            cast_s, built_s, alike = np.array(each).mean(axis=0)
            embree.append((1 / cast_s, 1 / (cast_s + built_s), alike))
    meshes = sum(part.mesh >= 0 for r in renderers for body in r.scene.bodies for part in body.parts)
    scenes = f"{len(renderers)} scenes, one of each set, {SIZE[1]}x{SIZE[0]}, {meshes} meshes in all, one thread"
    yield _row(f"renderer{kind}_frames_per_s", statistics.median(ours), f"{scenes}; shaded, edges smoothed")
    if peer:
        rate, whole, alike = np.median(embree, axis=0)
        said = f"the same rays at triangles, hits alone; same depth in {alike:.2%} of pixels"
        yield _row(f"embree{kind}_frames_per_s", rate, said)
        yield _row(
            f"embree{kind}_with_building_frames_per_s", whole, "with its tree, which is built anew for each frame"
        )


def _row(key: str, value: float, note: str) -> dict[str, Any]:
    return {"key": key, "value": float(value), "unit": "frames/s", "note": note}


def embree_frame(renderer: Renderer, time_s: float) -> tuple[float, float, float]:
    """Seconds for the rays and for the tree of one frame, and the share of pixels with the renderer's depth."""
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    corners = triangles_of(renderer.scene, time_s)
    camera = renderer.scene.camera.at(np.array([time_s]))
    rays = renderer.lens[0][0].reshape(2, -1).astype(np.float64)
    ways = np.float32(np.vstack((rays, np.ones(rays.shape[1]))).T @ camera.rotation[0].T)
    origins = np.float32(np.tile(camera.position[0], (len(ways), 1)))
    start = time.process_time()
    scene = EmbreeScene()
    TriangleMesh(scene, corners)
    scene.run(origins[:1], ways[:1], output=1)  # commits: builds the tree
    built_s = time.process_time() - start
    start = time.process_time()
    depth = scene.run(origins, ways, output=1)["tfar"]
    cast_s = time.process_time() - start
    known = renderer.lens[1].ravel()
    mine = renderer.frames(np.array([time_s])).depth[0].ravel()[known]
    return cast_s, built_s, float((np.abs(depth[known] - mine) < 0.01 * mine).mean())


def triangles_of(scene: Scene, time_s: float) -> NDArray[np.float32]:
    """All parts as triangles (T, 3, 3) in world axes, where they are at this time."""
    found = []
    for body in scene.bodies:
        turn, at = np.eye(3), np.zeros(3)
        if body.motion is not None:
            poses = body.motion.at(np.array([time_s]))
            turn, at = poses.rotation[0], poses.position[0]
        for part in body.parts:
            unit = _unit_triangles(part, scene) * part.half
            found.append((unit @ part.rotation.T + part.position) @ turn.T + at)
    return np.ascontiguousarray(np.concatenate(found), np.float32)


def _unit_triangles(part: Part, scene: Scene) -> F8:
    import trimesh

    if part.shape == GRATING:
        return _bars(part.openings)
    if part.shape == BOX:
        return np.asarray(trimesh.creation.box((2, 2, 2)).triangles)
    if part.shape == ELLIPSOID:
        return np.asarray(trimesh.creation.icosphere(BALL).triangles)
    if part.shape == CYLINDER:
        return np.asarray(trimesh.creation.cylinder(1, 2, sections=ROUND).triangles)
    meshes: MeshBank = scene.meshes
    first = meshes.nodes[meshes.roots[part.mesh] :]
    stop = meshes.roots[part.mesh + 1] - meshes.roots[part.mesh] if part.mesh + 1 < meshes.number else len(first)
    leaves = first[:stop][first[:stop, 1] > 0]
    rows = np.concatenate([np.arange(k, k + count) for k, count in leaves[:, :2]])
    return meshes.corners[rows].reshape(-1, 3, 3).astype(np.float64)


def _bars(openings: tuple[float, float, float, float]) -> F8:
    """A net as flat bars within the square from -1 to 1."""
    across, down, wide, high = openings
    quads = []
    for pitches, share, turned in ((across, wide, False), (down, high, True)):
        for k in range(int(np.ceil(2 * pitches))) if share > 0 else ():
            low, high_ = k / pitches - 1, min(1, (k + share) / pitches - 1)
            quad = np.array([(low, -1, 0), (high_, -1, 0), (high_, 1, 0), (low, 1, 0)])
            quads.append(quad[:, [1, 0, 2]] if turned else quad)
    if not quads:
        return np.zeros((0, 3, 3))
    return np.concatenate([quad[[[0, 1, 2], [0, 2, 3]]] for quad in quads])


def _timed(work: Any) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


def main() -> None:
    """Print the rows."""
    from rich.console import Console
    from rich.table import Table

    table = Table("what", "value", "unit", "note")
    for row in rendering_rows():
        table.add_row(row["key"], f"{row['value']:.1f}", row["unit"], row["note"])
    Console(width=130).print(table)


if __name__ == "__main__":
    main()
