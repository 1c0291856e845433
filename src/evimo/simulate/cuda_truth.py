# pyright: basic
"""Truth and image motion on a GPU: what `recordings.flow` and `recordings.prepared` say of depth and parts."""

import math
from typing import Any, NamedTuple

import numpy as np

from evimo.geometry.rectification import Rectification
from evimo.recordings.truth import MOVING_MPS, MOVING_RADPS
from evimo.scene.rays.on_device import THREADS, blocks, cuda
from evimo.scene.renderer import Renderer

f32, f64 = np.float32, np.float64
_LIMIT = f32(1e4)  # of flow, 1/s


class Motions(NamedTuple):
    """What moves how at S times. ids: (P,) of each part. ego: (S, 6).

    objects: (S, M + 1, 9) position, velocity and rotation of each id, camera axes; what is static has zeros.
    """

    ids: Any
    ego: Any
    objects: Any


class Places(NamedTuple):
    """Where the pixels (h, w) of a rectified image, flat, look in the sensor's.

    source: flat sensor pixel of each. seen: whether the lens sees it. grid: (2, h·w) its x, y on Z = 1.
    """

    source: Any
    seen: Any
    grid: Any


class Kinds(NamedTuple):
    """clutter: (P,) of each part, 0 is none. moving: (S, M + 1) whether each id moves."""

    clutter: Any
    moving: Any


class Seen(NamedTuple):
    """Truth at the centres of S slices in the rectified image, flat; as in `recordings.prepared.Prepared`."""

    depth: Any
    ids: Any
    moving: Any
    clutter: Any
    flow: Any


@cuda.jit(device=True)
def _flow(x, y, z, e, o):
    """Image velocity in 1/s of a point at x, y on Z = 1 and depth z, as in `recordings.flow.point_flow`.

    e: (6,) the camera's twist. o: (9,) position, velocity and rotation of the object that it is of.
    """
    px, py = x * z, y * z
    cx, cy, cz = px - o[0], py - o[1], z - o[2]
    u = -e[0] - (e[4] * z - e[5] * py) + o[3] + (o[7] * cz - o[8] * cy)
    v = -e[1] - (e[5] * px - e[3] * z) + o[4] + (o[8] * cx - o[6] * cz)
    w = -e[2] - (e[3] * py - e[4] * px) + o[5] + (o[6] * cy - o[7] * cx)
    return (u - x * w) / z, (v - y * w) / z


@cuda.jit
def _see(depth, tags, middles, first, motions, places, kinds, seen):
    """Truth of slices from `first` on, at frames `middles`."""
    q, j = cuda.grid(2)
    if q < len(places.source):
        f, k, i = middles[j], first + j, places.source[q]
        part = tags[f, i] >> 3
        if places.seen[q] and part >= 0:
            id_, clutter = motions.ids[part], kinds.clutter[part]
            seen.depth[k, q], seen.ids[k, q] = depth[f, i], id_
            seen.moving[k, q], seen.clutter[k, q] = kinds.moving[k, id_], clutter != 0
            x, y, z = places.grid[0, q], places.grid[1, q], f64(depth[f, i])
            u, v = _flow(x, y, z, motions.ego[k], motions.objects[k, id_])
            seen.flow[k, 0, q] = min(max(f32(u), -_LIMIT), _LIMIT)
            seen.flow[k, 1, q] = min(max(f32(v), -_LIMIT), _LIMIT)


@cuda.jit
def _hurry(rays, depth, parts, motions, focal_px, speed):
    """Speed in px/s along rays (2, N), at depth (S, N) on parts (S, N)."""
    q, k = cuda.grid(2)
    if q < rays.shape[1]:
        part = max(parts[k, q], 0)
        x, y, z = f64(rays[0, q]), f64(rays[1, q]), f64(depth[k, q])
        u, v = _flow(x, y, z, motions.ego[k], motions.objects[k, motions.ids[part]])
        speed[k, q] = focal_px * math.sqrt(u * u + v * v)


def add_truth(frames: Any, middles: np.ndarray, first: int, known: tuple[Motions, Places, Kinds], seen: Seen) -> None:
    """Write the truth of slices from `first` on, each at one of the `scene.renderer.Frames`, all on the GPU."""
    number, grid = frames.depth.shape[1] * frames.depth.shape[2], blocks(len(known[1].source))
    depth, tags = (values.reshape(values.shape[0], number) for values in (frames.depth, frames.tags))
    _see[(grid, len(middles)), (THREADS, 1)](depth, tags, cuda.to_device(middles), first, *known, seen)


def speeds(rays: Any, depth: Any, parts: Any, motions: Motions, focal_px: float) -> np.ndarray:
    """Speed (S, N) in px/s of what rays (2, N) meet at S times."""
    speed = cuda.device_array(depth.shape, np.float64)
    grid = (blocks(depth.shape[1]), depth.shape[0])
    _hurry[grid, (THREADS, 1)](cuda.to_device(rays), depth, parts, motions, focal_px, speed)
    return speed.copy_to_host()


def nothing_seen(slices: int, size: tuple[int, int]) -> Seen:
    """Truth to be written, on the GPU."""
    shape = (slices, size[0] * size[1])
    kinds = {"depth": np.float32, "ids": np.uint8, "moving": np.bool_, "clutter": np.bool_}
    arrays = {name: cuda.to_device(np.zeros(shape, kind)) for name, kind in kinds.items()}
    return Seen(**arrays, flow=cuda.to_device(np.zeros((slices, 2, shape[1]), np.float32)))


def motions_at(renderer: Renderer, time_s: np.ndarray) -> Motions:
    """Of the camera and all movers at times (S,)."""
    ego, objects = renderer.motions(time_s)
    rows = np.zeros((len(time_s), len(renderer.scene.movers) + 1, 9))
    for k, moved in enumerate(objects):
        for id_, motion in moved.items():
            rows[k, id_] = *motion.position, *motion.velocity, *motion.rotation
    return Motions(renderer.packed.ids, ego, rows)


def places_of(renderer: Renderer, rectification: Rectification) -> Places:
    """Of a rectified image of the renderer's camera."""
    source = rectification.source.ravel()
    straight, _ = renderer.camera.normalised(renderer.camera.pixels())
    seen = rectification.image_valid.ravel() & renderer.lens[1].ravel()[source]
    return Places(source, seen, np.ascontiguousarray(straight.reshape(-1, 2)[source].T))


def kinds_of(renderer: Renderer, motions: Motions) -> Kinds:
    """What counts as moving and as clutter."""
    speed, turn = (np.linalg.norm(motions.objects[..., part], axis=-1) for part in (slice(3, 6), slice(6, 9)))
    return Kinds(renderer.packed.clutter, (speed > MOVING_MPS) | (turn > MOVING_RADPS))
