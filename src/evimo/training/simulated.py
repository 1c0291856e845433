"""Batches from recordings that a GPU simulates while a model trains: nothing is stored, no event is ever in a list."""

from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import count
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import torch
from numpy.random import Generator
from torch import Tensor

from evimo.scene.drawing.scenes import SETS
from evimo.simulate.recording import simulate_recording
from evimo.training.batches import Batch
from evimo.training.data import augmented, drawn_reach

if TYPE_CHECKING:
    from evimo.simulate.cuda_slices import Ready

DRAW_STREAM = 0xBA7C  # of random numbers, besides those of the recordings


@dataclass(frozen=True, kw_only=True)
class SimulatedSource:
    """Which recordings, and how long each is used.

    seed: of the first recording; others follow. sets: that they are of, in turn. seconds: of each.
    sensor, camera, size, population: as in `simulate_recording`. part: what their scenes are held to.
    pool: recordings in memory at a time; a slice of 346x260 px takes 2.4 MB. batches: until the oldest is replaced.
    threads: of the CPU that draw scenes and work out lenses.
    """

    seed: int
    sets: tuple[int, ...] = tuple(SETS)
    seconds: float = 0.5
    sensor: str = "davis346"
    camera: str = "random"
    size: tuple[int, int] | None = None
    part: str | None = "train"
    population: str = "stress"
    pool: int = 64
    batches: int = 8
    threads: int = 4


class SliceTensors(NamedTuple):
    """Slices of one recording as torch tensors; fields, shapes and units of `recordings.prepared.Prepared`."""

    intrinsics: Tensor
    frames: Tensor
    valid: Tensor
    depth: Tensor
    ids: Tensor
    moving: Tensor
    flow: Tensor
    velocity: Tensor
    ego: Tensor


def simulated_batches(source: SimulatedSource, size: int, *, slices: int = 5) -> Iterator[Batch]:
    """Batches of `size` without end, augmented as those of stored recordings are; the same source gives the same ones.

    Raises:
        BadInput: there is no GPU or no numba-cuda, or no such set, sensor, camera or part.
    """
    rng = np.random.default_rng((source.seed, DRAW_STREAM))
    recordings = _simulated(source)
    pool = deque((next(recordings) for _ in range(source.pool)), source.pool)
    while True:
        for _ in range(source.batches):
            yield batch_from(pool, size, rng, slices=slices)
        pool.append(next(recordings))


def batch_from(pool: Sequence[SliceTensors], size: int, rng: Generator, *, slices: int = 5) -> Batch:
    """A random batch, augmented; every slice of every recording is as likely to be a sample's middle."""
    middles = [(recording, k) for recording in pool for k in range(len(recording.frames))]
    chosen = [middles[number] for number in rng.integers(len(middles), size=size)]
    rows = [_sample(recording, middle, slices, rng) for recording, middle in chosen]
    tensors = [torch.stack(column) for column in zip(*rows, strict=True)]
    return augmented(Batch(*tensors, events=None), rng)


def _simulated(source: SimulatedSource) -> Iterator[SliceTensors]:
    """One recording after another; the next few are made ready by threads meanwhile."""
    from evimo.simulate.cuda_slices import simulated_slices

    seeds, threads = count(source.seed), ThreadPoolExecutor(source.threads)
    try:
        waiting = deque(threads.submit(_made_ready, source, next(seeds)) for _ in range(2 * source.threads))
        while True:
            waiting.append(threads.submit(_made_ready, source, next(seeds)))
            made = simulated_slices(waiting.popleft().result())._asdict()
            yield SliceTensors(**{name: _tensor(made[name]) for name in SliceTensors._fields})
    finally:
        threads.shutdown(cancel_futures=True)


def _made_ready(source: SimulatedSource, seed: int) -> "Ready":
    from evimo.simulate.cuda_slices import made_ready

    recording = simulate_recording(
        seed,
        set_number=source.sets[seed % len(source.sets)],
        seconds=source.seconds,
        camera=source.camera,
        sensor=source.sensor,
        size=source.size,
        part=source.part,
        population=source.population,
        device="cuda",
    )
    return made_ready(recording)


def _tensor(values: Any) -> Tensor:
    """An array on the GPU as a tensor in the same memory; what is small comes from the host."""
    if hasattr(values, "__cuda_array_interface__"):
        return torch.as_tensor(values, device="cuda")
    values = values.copy_to_host() if hasattr(values, "copy_to_host") else values  # of numba's simulator
    return torch.from_numpy(np.ascontiguousarray(values)).to("cuda" if torch.cuda.is_available() else "cpu")


def _sample(recording: SliceTensors, middle: int, slices: int, rng: Generator) -> tuple[Tensor, ...]:
    """One sample as the tensors of `Batch`, without the batch axis."""
    half, reach = slices // 2, drawn_reach(slices, rng)
    frames = recording.frames.new_zeros((slices, *recording.frames.shape[1:]))
    first, last = max(0, middle - reach), min(len(recording.frames), middle + reach + 1)
    frames[first - middle + half : last - middle + half] = recording.frames[first:last]
    depth = recording.depth[middle][None]
    return (
        frames,
        recording.valid[None].float(),
        recording.intrinsics,
        depth,
        depth > 0,
        recording.moving[middle][None],
        recording.flow[middle],
        recording.velocity[middle][recording.ids[middle].long()].permute(2, 0, 1),
        recording.ego[middle],
    )
