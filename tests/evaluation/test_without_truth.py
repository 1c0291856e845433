"""Checks without truth, on events and masks whose motion is known."""

import numpy as np
import pytest
from pytest import approx

from evimo.evaluation.without_truth import Agreement, add_slice, carried, rotation_scores, warp_gain, without_flow
from evimo.events.events import Events
from evimo.geometry.camera import Camera
from evimo.geometry.rectification import rectified
from evimo.recordings.estimate import Estimate

SIZE = (60, 80)
CAMERA = Camera(50.0, 40.0, 39.5, 29.5, *SIZE)


def moving_dots(speed_px: tuple[float, float], *, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Whole pixels (N, 2) of 60 dots, each with an event every 0.25 ms, and times in s about the slice's centre."""
    rng = np.random.default_rng(seed)
    begin = rng.uniform((15, 15), (SIZE[1] - 15, SIZE[0] - 15), (60, 1, 2))
    time_s = np.tile(np.arange(-0.0125, 0.0125, 0.00025), (60, 1))
    at = np.rint(begin + time_s[..., None] * np.array(speed_px))
    return at.reshape(-1, 2), time_s.ravel()


@pytest.mark.parametrize("speed_px", [(240.0, 0.0), (-150.0, 200.0)])
def test_the_true_flow_sharpens_what_moves_and_others_do_not(speed_px):
    at, time_s = moving_dots(speed_px)
    gain = {sign: warp_gain(at, np.full(at.shape, sign) * np.array(speed_px), time_s, SIZE) for sign in (-1, 0, 0.5, 1)}
    assert gain[0] == 1
    assert gain[-1] < 1 < gain[0.5] < gain[1]
    assert gain[1] > 2.5  # dots were smeared over six pixels


def test_moving_events_by_fractions_of_pixels_neither_gains_nor_loses():
    """Noise has no motion: warped anyhow, it is as sharp as before."""
    rng = np.random.default_rng(1)
    gains = []
    for _ in range(20):
        at = rng.integers((0, 0), SIZE[::-1], (4000, 2)).astype(float)
        gains.append(warp_gain(at, rng.uniform(-80, 80, at.shape), rng.uniform(-0.0125, 0.0125, 4000), SIZE))
    assert np.mean(gains) == approx(1, abs=0.02)


def test_events_that_leave_the_image_count_in_neither():
    at, time_s = moving_dots((240.0, 0.0))
    leaving = np.full((5000, 2), 2.0), np.full(5000, -0.01)
    flow = np.vstack([np.tile((240.0, 0.0), (len(at), 1)), np.tile((-1e4, 0.0), (5000, 1))])
    both = warp_gain(np.vstack([at, leaving[0]]), flow, np.concatenate([time_s, leaving[1]]), SIZE)
    assert both == warp_gain(at, flow[: len(at)], time_s, SIZE)
    assert warp_gain(at[:150], flow[:150], time_s[:150], SIZE) is None  # too few to say


def test_a_mask_is_carried_along_the_flow_and_nothing_comes_from_outside():
    mask = np.zeros((6, 9), bool)
    mask[2:4, 0:3] = True
    flow = np.zeros((2, 6, 9))
    flow[0], flow[1] = 4, 1
    expected = np.zeros((6, 9), bool)
    expected[3:5, 4:7] = True
    np.testing.assert_array_equal(carried(mask, flow), expected)


def estimate(k: int, *, flow_px: float, has_events: bool = True) -> Estimate:
    """A square that moves 6 px to the right per slice, with a flow of `flow_px` px per slice everywhere."""
    probability = np.zeros(SIZE, np.float32)
    probability[20:30, 10 + 6 * k : 20 + 6 * k] = 1
    flow = np.zeros((2, *SIZE), np.float32)
    flow[0] = flow_px / 0.025 / CAMERA.fx
    start_us, ones = 25_000 * k, np.ones(SIZE, np.float32)
    return Estimate(
        t_us=start_us + 12_500,
        start_us=start_us,
        stop_us=start_us + 25_000,
        moving_probability=probability,
        ids=probability.astype(np.uint8),
        rel_depth=ones,
        flow=flow,
        confidence=ones,
        valid=np.full(SIZE, has_events),
        ego=np.arange(6.0),
        objects=(),
        has_events=has_events,
    )


def events_of(k: int) -> Events:
    """A hundred events in the square, three hundred outside."""
    y, x = np.mgrid[20:30, 10 + 6 * k : 20 + 6 * k].reshape(2, -1)
    y, x = np.append(y, np.tile(np.arange(30, 60), 10)), np.append(x, np.tile(np.arange(30), 10))
    t_us = 25_000 * k + np.arange(len(x))
    return Events(x.astype(np.uint16), y.astype(np.uint16), t_us, np.ones(len(x), np.int8))


def agreement_with(flow_px: float) -> Agreement:
    found = Agreement(rectified(CAMERA))
    for k in range(5):
        found.add(estimate(k, flow_px=flow_px), events_of(k), gain=None)
    return found


def test_masks_that_move_as_their_flow_says_are_consistent():
    scores = agreement_with(6).scores
    assert scores["consistency"].value == 1
    assert scores["consistency_still"].value == approx(4 / 16)  # columns of 10 that overlap in 4
    assert agreement_with(3).scores["consistency"].value == approx(7 / 13)
    assert scores["consistency"].samples == 4


def test_the_share_of_events_called_moving():
    assert agreement_with(6).scores["called_moving"].value == approx(100 / 400)


def test_a_slice_without_events_says_nothing_and_is_no_neighbour():
    found = Agreement(rectified(CAMERA))
    for k in range(5):
        found.add(estimate(k, flow_px=6, has_events=k != 2), events_of(k), gain=None)
    assert found.scores["consistency"].samples == 2
    assert found.times_us == [12_500, 37_500, 87_500, 112_500]
    np.testing.assert_array_equal(found.rotations, np.tile((3.0, 4, 5), (4, 1)))


def test_gains_of_models_are_of_the_same_slices():
    """A flow that carries all events out of the image has no gain: then no model's counts, nor zero flow's."""
    alone, both = Agreement(rectified(CAMERA)), [Agreement(rectified(CAMERA)) for _ in range(2)]
    for k in range(4):
        add_slice([alone], [estimate(k, flow_px=6)], events_of(k))
        wild = estimate(k, flow_px=1e5 if k == 1 else 6)
        add_slice(both, [estimate(k, flow_px=6), wild], events_of(k))
    assert alone.scores["warp_gain"].samples == 4
    assert [each.scores["warp_gain"].samples for each in both] == [3, 3]
    assert both[0].scores["warp_gain"] == both[1].scores["warp_gain"]
    assert both[0].scores["called_moving"].samples == alone.scores["called_moving"].samples
    assert without_flow(both[0].scores)["warp_gain"].samples == 3 and without_flow({}) == {}


def test_rotation_against_a_gyroscope():
    measured = np.array([[0.0, 0.5, 0], [0, 0.5, 0]])
    seen = np.array([[0.0, 0.5, 0], [0, 0.9, 0]])  # about one axis: angles subtract
    scores = rotation_scores(seen, measured, dt_s=0.025)
    assert scores["gyro_rre"].value == approx(0.2)
    assert scores["gyro_rre_ratio"].value == approx(0.4)
