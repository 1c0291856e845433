"""A GPU makes of a small world what the CPU makes of it: in numba's simulator, and on a GPU where there is one."""

import os
import pickle
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numba.cuda
import numpy as np
import pytest

from evimo.errors import BadInput, MissingExtra
from evimo.simulate.plan import RecordingPlan, told_plan
from evimo.simulate.recording import simulate_recording

PROGRAM = Path(__file__).with_name("both_processors.py")
HAS_GPU = find_spec("numba_cuda") is not None and numba.cuda.is_available()
needs_gpu = pytest.mark.skipif(not HAS_GPU, reason="no NVIDIA GPU with numba-cuda here")


class Compared(NamedTuple):
    """What both made, by name; and the least share of events that must be the very same."""

    found: dict
    alike: float


@pytest.fixture(
    scope="module", params=[pytest.param("simulator", marks=pytest.mark.slow), pytest.param("gpu", marks=needs_gpu)]
)
def both(request, tmp_path_factory) -> Compared:
    simulated = request.param == "simulator"
    file, size = tmp_path_factory.mktemp("cuda") / "found.pickle", ("10", "18") if simulated else ("260", "346")
    environment = os.environ | {"NUMBA_ENABLE_CUDASIM": "1" if simulated else "0"}
    subprocess.run([sys.executable, str(PROGRAM), str(file), *size], check=True, env=environment)
    return Compared(pickle.loads(file.read_bytes()), 1.0 if simulated else 0.9999)


def share_alike(mine, theirs):
    """The share of events that are the same in two lists, by order."""
    if not len(mine) == len(theirs) > 0:
        return 0.0
    same = [getattr(mine, name) == getattr(theirs, name) for name in "xytp"]
    return float(np.logical_and.reduce(same).mean())


def test_frames_are_the_same(both):
    (image, depth, tags), (its_image, its_depth, its_tags) = both.found["frames"]
    parts, its_parts = tags >> 3, its_tags >> 3
    assert len(np.unique(parts)) == 6  # all of the world is in view
    ids, its_ids = both.found["ids"][parts], both.found["ids"][its_parts]
    assert (ids == its_ids).mean() >= 0.99999
    assert (tags == its_tags).mean() >= 0.9999
    assert np.percentile(np.abs(image - its_image), 99.9) < 1e-3
    assert np.percentile(np.abs(depth / its_depth - 1), 99.9) < 1e-4


def test_edges_get_more_rays(both):
    image, tags = both.found["frames"][1][0][0], both.found["frames"][1][2][0]
    inside = np.ones_like(tags, bool)
    inside[1:-1, 1:-1] = [
        [len({int(tags[y + dy, x + dx]) for dy, dx in ((0, 0), (0, 1), (0, -1), (1, 0), (-1, 0))}) == 1
         for x in range(1, tags.shape[1] - 1)] for y in range(1, tags.shape[0] - 1)
    ]  # fmt: skip
    assert 0.1 < inside.mean() < 1
    assert len(np.unique(image[~inside])) > 0.9 * (~inside).sum()


def test_the_point_spread_has_opencvs_weights(both):
    for image, its in both.found["blurred"].values():
        np.testing.assert_allclose(its, image, rtol=1e-6)


@pytest.mark.parametrize("sensor", ["quiet", "noisy", "under lamps", "infinitely fast"])
def test_the_same_signal_fires_the_same_events(both, sensor):
    mine, theirs, (fed, its) = both.found["events"][sensor]
    for one, other in zip(fed, its, strict=True):
        np.testing.assert_allclose(other.ravel()[: one.size], one.ravel(), rtol=2e-6, atol=1e-6)
    assert min(map(len, mine)) > 100
    for one, other in zip(mine, theirs, strict=True):
        assert share_alike(one, other) >= both.alike


def test_a_film_of_the_same_times_fires_nearly_the_same_events(both):
    (mine, frames, _), (theirs, its_frames, _) = both.found["film"]
    assert (frames.tags == its_frames.tags).mean() > 0.9999
    assert len(theirs) == pytest.approx(len(mine), rel=1e-3)
    counts = [np.bincount(events.y * 1000 + events.x, minlength=10**6) for events in (mine, theirs)]
    assert np.abs(counts[0] - counts[1]).sum() <= 1e-3 * len(mine)


def test_training_reads_nearly_the_same_of_both(both):
    """A recording that is filmed into memory, as `evimo train --simulate` does: events in a list, truth beside them."""
    mine, theirs = both.found["prepared"]
    assert len(mine) == len(theirs) == 2
    assert 0 < mine.moving.mean() < 0.9
    for name in ("valid", "velocity", "ego"):
        np.testing.assert_array_equal(getattr(theirs, name), getattr(mine, name), err_msg=name)
    for name in ("ids", "moving", "clutter"):
        assert (getattr(theirs, name) == getattr(mine, name)).mean() > 0.999, name
    for name in ("depth", "flow"):
        off = np.abs(getattr(theirs, name).astype(float) - getattr(mine, name))
        assert np.percentile(off, 99.5) < 0.01, name
    assert np.diff(theirs.event_first).min() > 30
    np.testing.assert_allclose(np.diff(theirs.event_first), np.diff(mine.event_first), rtol=0.02)
    assert theirs.event_on.mean() == pytest.approx(mine.event_on.mean(), abs=0.02)


def test_recordings_of_another_device_are_told_apart():
    assert told_plan({"camera": {}})["device"] == "cpu"  # of before there was a choice
    assert told_plan({"camera": {}, "device": "cuda"})["device"] == "cuda"


@pytest.mark.skipif(HAS_GPU, reason="there is a GPU")
def test_without_a_gpu_the_device_is_refused_with_a_way_out():
    """By the CPU, or by what is missing for a GPU."""
    with pytest.raises((BadInput, MissingExtra), match=r"--device cpu|\[cuda\]"):
        simulate_recording(RecordingPlan(seed=1, device="cuda"))


def test_other_devices_are_refused():
    with pytest.raises(BadInput, match="no device 'tpu'"):
        simulate_recording(RecordingPlan(seed=1, device="tpu"))
