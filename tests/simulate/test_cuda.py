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

from evimo.errors import BadInput
from evimo.events.events import joined
from evimo.events.frames import PixelTable, event_frame
from evimo.geometry.rectification import rectified
from evimo.recordings.flow import true_flow
from evimo.simulate.recording import simulate_recording
from evimo.simulate.resuming import as_made

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


def test_slices_without_a_list_are_those_of_the_list(both):
    pieces, slices = both.found["pieces"], both.found["slices"]
    table = PixelTable(*rectified(both.found["camera"]).table())
    assert len(pieces) == len(slices["frames"]) == 2
    for k, piece in enumerate(pieces):
        frame = event_frame(piece.events, table, start_us=25_000 * k)
        assert frame[:2].sum() > 30
        np.testing.assert_allclose(slices["frames"][k], frame, atol=2e-6, rtol=2e-6)


def test_milliseconds_are_those_of_the_list(both):
    events, images = joined([piece.events for piece in both.found["pieces"]]), both.found["slices"]["milliseconds"]
    table = PixelTable(*rectified(both.found["camera"]).table())
    for ms in range(0, 50, 7):
        first, last = np.searchsorted(events.t, (1000 * ms, 1000 * ms + 1000))
        frame = event_frame(events.part(first, last), table, start_us=1000 * ms, dt_us=1000)
        np.testing.assert_allclose(images[ms // 25, ms % 25], frame[0] + frame[1], atol=2e-6, rtol=2e-6)


def test_truth_is_the_recordings_in_the_rectified_image(both):
    camera, slices = both.found["camera"], both.found["slices"]
    rectification, grid = rectified(camera), np.moveaxis(camera.normalised(camera.pixels())[0], -1, 0)
    assert 0 < slices["moving"].mean() < 0.9
    for k, piece in enumerate(both.found["pieces"]):
        truth = piece.truth
        for name in ("ids", "clutter"):
            np.testing.assert_array_equal(slices[name][k], rectification.from_sensor(getattr(truth, name)))
        depth = rectification.from_sensor(np.where(truth.valid, truth.depth, 0))
        np.testing.assert_array_equal(slices["depth"][k], depth)
        flow = rectification.from_sensor(true_flow(truth, grid))
        np.testing.assert_allclose(slices["flow"][k], flow, atol=1e-5)
        np.testing.assert_allclose(slices["ego"][k], truth.ego, rtol=1e-6)
        for id_, moved in truth.objects.items():
            moves = np.linalg.norm(moved.velocity) > 0.03 or np.linalg.norm(moved.rotation) > 0.17
            np.testing.assert_allclose(slices["velocity"][k, id_], moved.velocity * moves, rtol=1e-6)
            np.testing.assert_array_equal(slices["moving"][k][slices["ids"][k] == id_], moves)


def test_recordings_of_another_device_are_told_apart():
    assert as_made({"camera": {}})["device"] == "cpu"  # of before there was a choice
    assert as_made({"camera": {}, "device": "cuda"})["device"] == "cuda"


@pytest.mark.skipif(HAS_GPU, reason="there is a GPU")
def test_without_a_gpu_the_device_is_refused_with_a_way_out():
    with pytest.raises(BadInput, match="--device cpu"):
        simulate_recording(1, device="cuda")


def test_other_devices_are_refused():
    with pytest.raises(BadInput, match="no device 'tpu'"):
        simulate_recording(1, device="tpu")
