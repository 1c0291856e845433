"""Prepared recordings to batches: which slices and part of the image, what is missing, which way round."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from hashlib import sha256

import numpy as np
import torch
from numpy.random import Generator
from numpy.typing import NDArray

from evimo.events.local_motion import motion_candidates
from evimo.events.slices import SLICE_US
from evimo.events.stack import CELL, SLICES, EventStack, StaticMotion, compensated, plane_fits, voxel_grid
from evimo.geometry.rectification import halved_mask
from evimo.geometry.warping import EventPoints
from evimo.recordings.prepared import SUBPIXEL, Prepared
from evimo.training.batches import Batch
from evimo.training.disturbance import disturbed
from evimo.training.orientation import AS_FILMED, Orientation, drawn_orientation

Pairs = np.ndarray[tuple[int, int], np.dtype[np.int64]]
Row = tuple[np.ndarray, ...]  # one sample: the arrays of `Batch`, without the batch axis, then its events

HALF = SLICES // 2
DROPPED_OUTER = 0.15  # share of samples whose outer slices are missing, as at the ends of a recording
GYROSCOPE, GYROSCOPE_RAD_S = 0.3, 0.02  # share of samples that know their rotation, and its error, rms
CROP = (160, 192)  # px, of larger images; a multiple of every preset's stride
DEPTH_STEP = 4  # px per pixel of the depth that compensations use
SLICE_S = SLICE_US * 1e-6


@dataclass(frozen=True, slots=True)
class Samples:
    """Every slice of every recording is the middle of one sample."""

    recordings: Sequence[Prepared]
    index: Pairs  # (N, 2) recording, slice

    def __len__(self) -> int:
        return len(self.index)

    def fingerprint(self) -> str:
        """What tells these recordings, in this order, from others: how many events each slice has."""
        counts = sha256(self.index.tobytes())
        for recording in self.recordings:
            counts.update(recording.event_first.tobytes())
        return counts.hexdigest()


@dataclass(frozen=True, slots=True)
class Window:
    """A part of the rectified image: `size` (height, width) from (top, left), all even.

    picked: which of each two rows, and of each two columns, truth at half the size is read from. A sample draws it:
    always from the lower ones, networks learned masks that lie a third of a pixel too high, as few samples are mirrored
    along y.
    """

    top: int
    left: int
    size: tuple[int, int]
    picked: tuple[int, int] = (1, 1)

    def half(self, image: NDArray[np.generic]) -> NDArray[np.generic]:
        """Every other pixel of (..., H, W), zero beyond the image: (..., h, w)."""
        height, width = self.size
        row, column = self.top + self.picked[0], self.left + self.picked[1]
        inside = image[..., row : self.top + height : 2, column : self.left + width : 2]
        missing = [(0, full // 2 - has) for full, has in zip(self.size, inside.shape[-2:], strict=True)]
        return np.pad(inside, [(0, 0)] * (image.ndim - 2) + missing) if any(m for _, m in missing) else inside

    def share(self, mask: NDArray[np.bool_]) -> NDArray[np.float32]:
        """The share of each pixel's four that a mask (H, W) holds, as a run has it: (h, w)."""
        height, width = self.size
        return halved_mask(mask[self.top : self.top + height, self.left : self.left + width], self.size)


def samples_of(recordings: Sequence[Prepared]) -> Samples:
    """All samples of some recordings; those without any event have none."""
    pairs = [
        (number, middle)
        for number, recording in enumerate(recordings)
        if len(recording.event_t)
        for middle in recording.middles().tolist()
    ]
    return Samples(recordings, np.array(pairs, np.int64).reshape(-1, 2))


def drawn_row(samples: Samples, rng: Generator) -> Row:
    """A random sample, augmented: a crop, turned round at random, with a compensation of any quality."""
    recording, middle = samples.index[rng.integers(len(samples))].tolist()
    return drawn_sample(samples.recordings[recording], middle, rng)


def whole_batch(recording: Prepared, middles: Sequence[int], motions: Sequence[StaticMotion], stride: int) -> Batch:
    """These slices as they are, whole, padded to multiples of the stride, compensated by these motions."""
    height, width = (-(-side // stride) * stride for side in recording.valid.shape)
    window = Window(0, 0, (height, width))
    rows = [
        _sample(stack_of(recording, k), recording, k, window=window, motion=motion, rotation=np.zeros(4, np.float32))
        for k, motion in zip(middles, motions, strict=True)
    ]
    return stacked(rows, events=False)


def stack_of(recording: Prepared, middle: int, *, reach: int = HALF) -> EventStack:
    """The events of the slices about a middle one, `reach` to each side."""
    first, last = max(0, middle - reach), min(len(recording), middle + reach + 1)
    begin, end = int(recording.event_first[first]), int(recording.event_first[last])
    x, y = (recording.event_xy[begin:end] / np.float32(SUBPIXEL)).astype(np.float32).T.copy()
    counts = np.diff(recording.event_first[first : last + 1])
    whole = np.repeat(np.arange(first - middle, last - middle, dtype=np.float32), counts)
    t = (whole + recording.event_t[begin:end] / np.float32(SLICE_US) - np.float32(0.5)).astype(np.float32)
    return EventStack(x, y, t, np.asarray(recording.event_on[begin:end]))


def true_motion(recording: Prepared, middle: int) -> StaticMotion:
    """How the static world truly moves about a middle slice; unknown depth is the mean one."""
    depth = recording.depth[middle][DEPTH_STEP // 2 :: DEPTH_STEP, DEPTH_STEP // 2 :: DEPTH_STEP].astype(np.float32)
    known = depth > 0
    mean = float(depth[known].mean()) if known.any() else 1.0
    slices = np.clip(np.arange(middle - HALF, middle + HALF + 1), 0, len(recording) - 1)
    twist = recording.ego[slices] * np.float32(SLICE_S)
    twist[:, :3] /= mean
    inv_depth = np.where(known, mean / np.maximum(depth, 1e-3), 1).astype(np.float32)
    return StaticMotion(twist.astype(np.float32), inv_depth, DEPTH_STEP, recording.intrinsics)


def drawn_sample(recording: Prepared, middle: int, rng: Generator) -> Row:
    """One augmented sample as the arrays of `Batch`, without the batch axis, then its events."""
    reach = int(rng.integers(0, HALF)) if rng.random() < DROPPED_OUTER else HALF
    known_rotation = bool(rng.random() < GYROSCOPE)
    rotation = np.zeros(4, np.float32)
    if known_rotation:
        error = rng.normal(size=3) * GYROSCOPE_RAD_S
        rotation[:] = (*(recording.ego[middle, 3:] + error) * SLICE_S, 1)
    motion = disturbed(true_motion(recording, middle), rng, known_rotation=known_rotation)
    stack = stack_of(recording, middle, reach=reach)
    window, way = _drawn_window(recording.valid.shape, rng), drawn_orientation(rng)
    window = replace(window, picked=(int(rng.integers(2)), int(rng.integers(2))))
    return _sample(stack, recording, middle, window=window, motion=motion, rotation=rotation, way=way)


def _drawn_window(size: tuple[int, int], rng: Generator) -> Window:
    """A place for a crop, even; an image that is smaller is padded."""
    spare = [max(0, side - crop) // 2 for side, crop in zip(size, CROP, strict=True)]
    top, left = (2 * int(rng.integers(steps + 1)) for steps in spare)
    return Window(top, left, CROP)


def _sample(
    stack: EventStack,
    recording: Prepared,
    middle: int,
    *,
    window: Window,
    motion: StaticMotion,
    rotation: NDArray[np.float32],
    way: Orientation = AS_FILMED,
) -> Row:
    """What `Batch` holds, in its order, then the events of the middle slice."""
    size = window.size
    cells = size[0] // CELL, size[1] // CELL
    raw = way.of_events(_moved(stack, window), size)
    sharp = way.of_events(_moved(compensated(stack, motion), window), size)
    ids, depth = recording.ids[middle], window.half(recording.depth[middle]).astype(np.float32)[None]
    velocity = np.moveaxis(recording.velocity[middle][window.half(ids)], -1, 0).astype(np.float32)
    now = np.abs(raw.t) <= 0.5
    voxels, valid = voxel_grid(raw, cells, step=CELL), window.share(recording.valid)
    taken_ego, taken_depth = _taken(motion, window, valid)
    return (
        voxels,
        plane_fits(raw, cells),
        motion_candidates(voxels),
        voxel_grid(sharp, size),
        plane_fits(sharp, cells),
        way.of_twist(taken_ego),
        way.of_image(taken_depth[None]),
        np.append(way.of_twist(np.concatenate((np.zeros(3, np.float32), rotation[:3])))[3:], rotation[3:]),
        way.of_image(valid[None]),
        way.of_intrinsics(recording.intrinsics - np.array((0, 0, window.left, window.top), np.float32), size),
        way.of_image(depth),
        way.of_image(depth) > 0,
        way.of_image(window.half(recording.moving[middle])[None]),
        way.of_vectors(window.half(recording.flow[middle]).astype(np.float32)),
        way.of_vectors(velocity),
        way.of_twist(np.array(recording.ego[middle])),
        np.stack((raw.x[now], raw.y[now], raw.t[now] * np.float32(SLICE_S), raw.positive[now])),
    )


def _moved(stack: EventStack, window: Window) -> EventStack:
    """In pixels of the window; what is outside is left out."""
    height, width = window.size
    x, y = stack.x - np.float32(window.left), stack.y - np.float32(window.top)
    inside = (x > -0.5) & (x < width - 0.5) & (y > -0.5) & (y < height - 0.5)
    return EventStack(x[inside], y[inside], stack.t[inside], stack.positive[inside])


def _taken(
    motion: StaticMotion, window: Window, valid: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The middle slice's twist (6,) of a compensation, and its depth on a quarter of the window's pixels, each way.

    In the unit of a run, where what is taken out has a mean depth of 1 over all that the lens sees: of the window.

    valid: (h, w) share of each pixel of half the window's size.
    """
    height, width = (side // DEPTH_STEP for side in window.size)
    rows = np.minimum((np.arange(height) * DEPTH_STEP + window.top + 2) // motion.step, len(motion.inv_depth) - 1)
    columns = (np.arange(width) * DEPTH_STEP + window.left + 2) // motion.step
    used = motion.inv_depth[rows][:, np.minimum(columns, motion.inv_depth.shape[1] - 1)]
    depth = np.reciprocal(np.maximum(used, np.float32(0.02)))
    share = valid.reshape(height, 2, width, 2).mean((1, 3))
    mean = float((depth * share).sum() / share.sum()) if share.any() else 1.0
    ego = motion.twist[HALF] / np.repeat((mean, 1), 3)
    return ego.astype(np.float32), (depth / mean).astype(np.float32)


def stacked(rows: Sequence[Row], *, events: bool = False) -> Batch:
    """The batch of some samples; events: whether those of the middle slices come along."""
    tensors = [torch.from_numpy(np.stack(column)) for column in list(zip(*rows, strict=True))[:-1]]
    return Batch(*tensors, events=_events([row[-1] for row in rows]) if events else None)


def _events(columns: Sequence[NDArray[np.float32]]) -> EventPoints:
    """The events of the middle slices, time relative to their centres."""
    number = torch.from_numpy(np.repeat(np.arange(len(columns)), [each.shape[1] for each in columns]))
    x, y, t, positive = torch.from_numpy(np.concatenate(columns, axis=1))
    return EventPoints(number, x, y, t, positive > 0)
