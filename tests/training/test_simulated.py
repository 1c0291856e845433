"""Batches from slices that a GPU made are those of the same slices stored; which slices it makes, test_cuda.py says."""

import numpy as np
import torch

from evimo.training.data import drawn_batch
from evimo.training.simulated import SliceTensors, batch_from


def as_made(recording) -> SliceTensors:
    """A prepared recording as a GPU would have made it."""
    columns = {name: getattr(recording, name) for name in SliceTensors._fields}
    whole = {name: np.array(a, np.float32) if a.dtype == np.float16 else np.array(a) for name, a in columns.items()}
    return SliceTensors(**{name: torch.from_numpy(values) for name, values in whole.items()})


def test_batches_are_those_of_the_same_slices_stored(samples):
    pool = [as_made(recording) for recording in samples.recordings]
    for seed in range(4):
        stored = drawn_batch(samples, 5, np.random.default_rng(seed))
        made = batch_from(pool, 5, np.random.default_rng(seed))
        for one, other in zip(stored[:9], made[:9], strict=True):
            torch.testing.assert_close(other, one, rtol=0, atol=0)


def test_every_slice_becomes_a_middle(samples):
    pool = [as_made(samples.recordings[0])]
    drawn = [batch_from(pool, 1, np.random.default_rng(seed), slices=1) for seed in range(60)]
    times = {round(float(batch.frames[:, :, 2].sum()), 2) for batch in drawn}
    assert len(times) == len(pool[0].frames)
