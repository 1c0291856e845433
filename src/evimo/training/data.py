"""Prepared recordings to batches: which slices, which neighbours are missing, which way round."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.random import Generator

from evimo.events.slices import SLICE_US
from evimo.geometry.warping import EventPoints
from evimo.recordings.prepared import SUBPIXEL, Prepared
from evimo.training.batches import Batch

Pairs = np.ndarray[tuple[int, int], np.dtype[np.int64]]

DROPPED_OUTER = 0.2  # share of samples whose outer slices are missing, as at the ends of a recording


@dataclass(frozen=True, slots=True)
class Samples:
    """Every slice of every recording is the middle of one sample; recordings of one image size."""

    recordings: Sequence[Prepared]
    index: Pairs  # (N, 2) recording, slice

    def __len__(self) -> int:
        return len(self.index)


def samples_of(recordings: Sequence[Prepared]) -> Samples:
    """All samples of some recordings."""
    pairs = [(number, middle) for number, recording in enumerate(recordings) for middle in range(len(recording))]
    return Samples(recordings, np.array(pairs, np.int64).reshape(-1, 2))


def drawn_batch(samples: Samples, size: int, rng: Generator, *, slices: int = 5, events: bool = False) -> Batch:
    """A random batch, augmented: missing outer slices, mirrored left-right and top-bottom, polarities exchanged."""
    chosen = rng.integers(len(samples), size=size)
    return augmented(_stacked(samples, samples.index[chosen], slices, rng, events=events), rng)


def augmented(batch: Batch, rng: Generator) -> Batch:
    """A batch, at random mirrored left-right and top-bottom, and with polarities exchanged."""
    if rng.random() < 0.5:
        batch = mirrored(batch, axis=0)
    if rng.random() < 0.25:
        batch = mirrored(batch, axis=1)
    if rng.random() < 0.5:
        batch = batch._replace(frames=batch.frames[:, :, [1, 0, 2]])
        if batch.events:
            batch = batch._replace(events=batch.events._replace(positive=~batch.events.positive))
    return batch


def batch_of(samples: Samples, chosen: Sequence[int], *, slices: int = 5) -> Batch:
    """These samples, as they are."""
    return _stacked(samples, samples.index[list(chosen)], slices, None, events=False)


def _stacked(samples: Samples, index: Pairs, slices: int, rng: Generator | None, *, events: bool) -> Batch:
    pairs: list[list[int]] = index.tolist()
    rows = [_sample(samples.recordings[r], k, slices, rng) for r, k in pairs]
    tensors = [torch.from_numpy(np.stack(column)) for column in zip(*rows, strict=True)]
    return Batch(*tensors, events=_events([(samples.recordings[r], k) for r, k in pairs]) if events else None)


def _events(chosen: Sequence[tuple[Prepared, int]]) -> EventPoints:
    """The events of the middle slices, time relative to their centres."""
    parts: list[tuple[np.ndarray, ...]] = []
    for number, (recording, k) in enumerate(chosen):
        cut = slice(*recording.event_first[k : k + 2].tolist())
        xy = recording.event_xy[cut].astype(np.float32) / SUBPIXEL
        t = (recording.event_t[cut].astype(np.float32) - SLICE_US / 2) * 1e-6
        parts.append((np.full(len(t), number), xy[:, 0], xy[:, 1], t, np.array(recording.event_on[cut])))
    return EventPoints(*(torch.from_numpy(np.concatenate(column)) for column in zip(*parts, strict=True)))


def mirrored(batch: Batch, *, axis: int) -> Batch:
    """The batch as a camera mirrored along x (axis 0) or y (axis 1) would have seen it.

    A mirror along x turns the x of vectors, and of turns everything but x.
    """
    image_axis = -1 - axis
    last = batch.frames.shape[image_axis] - 1
    intrinsics = batch.intrinsics.clone()
    intrinsics[:, 2 + axis] = last - intrinsics[:, 2 + axis]
    turned = batch.ego.new_ones(3)
    turned[axis] = -1
    flipped = [tensor.flip(image_axis) if tensor.dim() >= 4 else tensor for tensor in batch[:9]]
    events = batch.events
    if events is not None:
        events = events._replace(x=last - events.x) if axis == 0 else events._replace(y=last - events.y)
    result = Batch(*flipped, events=events)
    return result._replace(
        intrinsics=intrinsics,
        flow=result.flow * turned[:2].view(1, 2, 1, 1),
        velocity=result.velocity * turned.view(1, 3, 1, 1),
        ego=torch.cat((batch.ego[:, :3] * turned, -batch.ego[:, 3:] * turned), dim=1),
    )


def drawn_reach(slices: int, rng: Generator | None) -> int:
    """How many slices are there before and after the middle one; without a generator all of them."""
    half = slices // 2
    if rng is not None and rng.random() < DROPPED_OUTER:
        return int(rng.integers(1, half)) if half > 1 and rng.random() < 0.9 else 0
    return half


def _sample(recording: Prepared, middle: int, slices: int, rng: Generator | None) -> tuple[np.ndarray, ...]:
    """One sample as the arrays of `Batch`, without the batch axis."""
    half, reach = slices // 2, drawn_reach(slices, rng)
    frames = np.zeros((slices, *recording.frames.shape[1:]), np.float32)
    first, last = max(0, middle - reach), min(len(recording), middle + reach + 1)
    frames[first - middle + half : last - middle + half] = recording.frames[first:last]
    ids = recording.ids[middle]
    depth = recording.depth[middle].astype(np.float32)[None]
    return (
        frames,
        recording.valid[None].astype(np.float32),
        recording.intrinsics,
        depth,
        depth > 0,
        recording.moving[middle][None].copy(),
        recording.flow[middle].astype(np.float32),
        np.moveaxis(recording.velocity[middle][ids], -1, 0).astype(np.float32).copy(),
        np.array(recording.ego[middle]),
    )
