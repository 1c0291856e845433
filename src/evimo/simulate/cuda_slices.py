# pyright: basic
"""Slices made straight into arrays on a GPU, without a list of events: what training reads, in the rectified image."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from evimo.events.frames import PixelTable
from evimo.geometry.rectification import Rectification, rectified
from evimo.recordings.prepared import MOVING_MPS, MOVING_RADPS
from evimo.scene.on_device import THREADS, blocks, cuda, uploaded
from evimo.scene.renderer import Renderer
from evimo.simulate.cuda_film import CudaFilm
from evimo.simulate.cuda_pixels import SliceSums, slice_sums
from evimo.simulate.cuda_splat import Splat, frames_of, milliseconds_of, splat_through
from evimo.simulate.film import steps
from evimo.simulate.recording import EVENT_STREAM, SLICE_S, WARM_UP_S, SimulatedRecording

f32, f64 = np.float32, np.float64
FRAMES_AT_ONCE = 256  # rendered in one go, about: bounds memory
_LIMIT = f32(1e4)  # of flow, 1/s


class Seen(NamedTuple):
    """Truth at the centres of S slices in the rectified image (h, w), flat; as in `recordings.prepared.Prepared`."""

    depth: Any
    ids: Any
    moving: Any
    clutter: Any
    flow: Any


class Known(NamedTuple):
    """What truth follows from, besides depth and parts.

    source: (h·w,) flat sensor pixel that each pixel sees; seen: whether the lens does.
    grid: (2, h·w) its x, y on Z = 1.
    ids, clutter: (P,) of each part. ego: (S, 6). objects: (S, M + 1, 9) position, velocity and rotation of each id.
    moving: (S, M + 1) whether it moves.
    """

    source: Any
    seen: Any
    grid: Any
    ids: Any
    clutter: Any
    ego: Any
    objects: Any
    moving: Any


class CudaSlices(NamedTuple):
    """All slices of one recording in the rectified image (h, w): the fields of `Prepared`; float32 instead of float16.

    On the GPU, but `intrinsics`, `valid`, `velocity` and `ego`, which are small. sums, splat: for `milliseconds`.
    """

    intrinsics: np.ndarray
    frames: Any
    valid: np.ndarray
    depth: Any
    ids: Any
    moving: Any
    clutter: Any
    flow: Any
    velocity: np.ndarray
    ego: np.ndarray
    sums: SliceSums
    splat: Splat

    def milliseconds(self) -> Any:
        """Events of each millisecond, (S, 25, h, w) float32: made on demand, for they take ten times a slice's room."""
        return milliseconds_of(self.sums, self.splat, self.frames.shape[2:])


@cuda.jit
def _see(depth, tags, middles, first, known, seen):
    """Truth of slices from `first` on, at frames `middles`."""
    q, j = cuda.grid(2)
    if q < known.source.shape[0] and j < middles.shape[0]:
        f, k, i = middles[j], first + j, known.source[q]
        part = tags[f, i] >> 3
        if known.seen[q] and part >= 0:
            z, id_, x, y = f64(depth[f, i]), known.ids[part], known.grid[0, q], known.grid[1, q]
            seen.depth[k, q], seen.ids[k, q] = depth[f, i], id_
            seen.moving[k, q], seen.clutter[k, q] = known.moving[k, id_], known.clutter[part] != 0
            px, py, pz = x * z, y * z, z
            e, o = known.ego[k], known.objects[k, id_]
            cx, cy, cz = px - o[0], py - o[1], pz - o[2]
            u = -e[0] - (e[4] * pz - e[5] * py) + o[3] + (o[7] * cz - o[8] * cy)
            v = -e[1] - (e[5] * px - e[3] * pz) + o[4] + (o[8] * cx - o[6] * cz)
            w = -e[2] - (e[3] * py - e[4] * px) + o[5] + (o[6] * cy - o[7] * cx)
            seen.flow[k, 0, q] = min(max(f32((u - x * w) / z), -_LIMIT), _LIMIT)
            seen.flow[k, 1, q] = min(max(f32((v - y * w) / z), -_LIMIT), _LIMIT)


def simulated_slices(recording: SimulatedRecording) -> CudaSlices:
    """Film a recording into arrays on the GPU. Memory grows with its length: 5.5 MB a slice of 346x260 px."""
    renderer, rectification = Renderer(recording.scene, recording.camera), rectified(recording.camera)
    rng = np.random.default_rng((recording.seed, recording.set_number, EVENT_STREAM))
    film = CudaFilm(renderer, recording.settings, rng, start_s=-WARM_UP_S)
    number, size = recording.camera.height * recording.camera.width, rectification.image.size
    sums = slice_sums(recording.slices, number, start_us=0, tick_us=recording.settings.tick_us)
    known, velocity = _known(renderer, rectification, recording.slices)
    seen = _nothing_seen(recording.slices, size)
    film.pixels.add_events(film.fed([steps(renderer, -WARM_UP_S, 0.0)[0]])[0], sums)
    for first, stretches in _chunks(renderer, recording.slices):
        fed, frames = film.fed(stretches)
        film.pixels.add_events(fed, sums)
        lengths = np.array([len(times) - 1 for times in stretches])
        middles = cuda.to_device(np.cumsum(lengths) - lengths + lengths // 2)
        grid = ((blocks(size[0] * size[1]), len(stretches)), (THREADS, 1))
        flat = (values.reshape(values.shape[0], number) for values in frames[1:])
        _see[grid](*flat, middles, first, known, seen)
    splat, image = splat_through(PixelTable(*rectification.table())), rectification.image
    shaped = {name: values.reshape(*values.shape[:-1], *size) for name, values in seen._asdict().items()}
    return CudaSlices(
        intrinsics=np.array((image.fx, image.fy, image.cx, image.cy), np.float32),
        frames=frames_of(sums, splat, size),
        valid=rectification.image_valid,
        velocity=velocity,
        ego=known.ego.copy_to_host().astype(np.float32),
        sums=sums,
        splat=splat,
        **shaped,
    )


def _chunks(renderer: Renderer, slices: int) -> Iterator[tuple[int, list[np.ndarray]]]:
    """The first slice and the times of frames of some slices at a time."""
    first, stretches = 0, []
    for k in range(slices):
        stretches.append(steps(renderer, k * SLICE_S, (k + 1) * SLICE_S)[0])
        if sum(map(len, stretches)) >= FRAMES_AT_ONCE or k == slices - 1:
            yield first, stretches
            first, stretches = k + 1, []


def _known(renderer: Renderer, rectification: Rectification, slices: int) -> tuple[Any, np.ndarray]:
    """`Known`, on the GPU; and the velocity (S, 256, 3) of each id."""
    centre_s = np.arange(0.5, slices) * SLICE_S
    ego, objects = renderer.motions(centre_s)
    rows = np.zeros((slices, len(renderer.scene.movers) + 1, 9))
    for k, moved in enumerate(objects):
        for id_, motion in moved.items():
            rows[k, id_] = *motion.position, *motion.velocity, *motion.rotation
    speed, turn = (np.linalg.norm(rows[..., part], axis=-1) for part in (slice(3, 6), slice(6, 9)))
    moving = (speed > MOVING_MPS) | (turn > MOVING_RADPS)
    velocity = np.zeros((slices, 256, 3), np.float32)
    velocity[:, : rows.shape[1]] = rows[..., 3:6] * moving[..., None]
    source = rectification.source.ravel()
    straight, _ = renderer.camera.normalised(renderer.camera.pixels())
    known = Known(
        source=source,
        seen=rectification.image_valid.ravel() & renderer.lens[1].ravel()[source],
        grid=np.ascontiguousarray(straight.reshape(-1, 2)[source].T),
        ids=renderer.packed.ids,
        clutter=renderer.packed.clutter,
        ego=ego,
        objects=rows,
        moving=moving,
    )
    return uploaded(known), velocity


def _nothing_seen(slices: int, size: tuple[int, int]) -> Seen:
    shape = (slices, size[0] * size[1])
    kinds = {"depth": np.float32, "ids": np.uint8, "moving": np.bool_, "clutter": np.bool_}
    arrays = {name: cuda.to_device(np.zeros(shape, kind)) for name, kind in kinds.items()}
    return Seen(**arrays, flow=cuda.to_device(np.zeros((slices, 2, shape[1]), np.float32)))
