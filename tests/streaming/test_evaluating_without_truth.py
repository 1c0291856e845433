"""A model checked without truth, on discs that move and a gyroscope that is made up."""

from dataclasses import replace

import numpy as np
import pytest
from pytest import approx

from evimo.errors import BadInput
from evimo.evaluation import baselines
from evimo.evaluation.report import MODEL
from evimo.evaluation.tables import as_markdown
from evimo.events.gyroscope import Gyroscope
from evimo.streaming.evaluating_without_truth import evaluate_without_truth
from evimo.streaming.pipeline import run


def turning(start_us: int, stop_us: int, rate: tuple[float, float, float]) -> Gyroscope:
    t_us = np.arange(start_us - 50_000, stop_us + 50_000, 1000)
    return Gyroscope(t_us, np.tile(np.array(rate), (len(t_us), 1)), True, "made up")


def test_estimates_from_events_alone_are_compared_with_the_gyroscope(discs, recorded, camera, fake_network):
    seen = [each.ego[3:] for each in run(recorded(discs), model=fake_network, camera=camera, imu="off")]
    rate = (0.3, -0.2, 0.1)
    recording = recorded(discs, read_gyroscope=lambda: turning(int(discs.t[0]), int(discs.t[-1]), rate))
    report = evaluate_without_truth([recording], model=fake_network, camera=camera)
    errors = np.linalg.norm(np.array(seen) - rate, axis=1)  # small angles: their difference
    assert report.value(MODEL, "gyro_rre") == approx(errors.mean(), rel=1e-3)
    assert report.settings["gyroscope of made.txt"] == "made up, in camera axes"


def test_a_gyroscope_in_its_own_axes_is_aligned_once_for_all_rows(discs, recorded, camera, fake_network, monkeypatch):
    """To the checked model: one that fits the classical method better would flatter it."""
    asked: list[np.ndarray] = []

    def in_own_axes(gyroscope, times_us, rotation, weight):
        asked.append(rotation)

    monkeypatch.setattr("evimo.streaming.rotation.aligned", in_own_axes)
    own = replace(turning(int(discs.t[0]), int(discs.t[-1]), (0.3, 0, 0)), in_camera_axes=False)
    report = evaluate_without_truth([recorded(discs, read_gyroscope=lambda: own)], model=fake_network, camera=camera)
    seen = [each.ego[3:] for each in run(recorded(discs), model=fake_network, camera=camera, imu="off")]
    assert len(asked) == 1
    np.testing.assert_array_equal(asked[0], seen)
    assert "gyro_rre" not in report.rows["classical"]


def test_rows_are_of_the_same_slices(discs, recorded, camera, fake_network):
    rate = (0.3, -0.2, 0.1)
    recording = recorded(discs, read_gyroscope=lambda: turning(int(discs.t[0]), int(discs.t[-1]), rate))
    rows = evaluate_without_truth([recording], model=fake_network, camera=camera).rows
    for score in ("warp_gain", "gyro_rre"):
        assert len({row[score].samples for row in rows.values() if score in row}) == 1


def test_the_classical_fit_and_zero_flow_stand_beside(discs, recorded, camera, fake_network):
    report = evaluate_without_truth([recorded(discs), recorded(discs)], model=fake_network, camera=camera)
    assert list(report.rows) == [MODEL, "classical", baselines.ZERO_FLOW]
    assert report.value(baselines.ZERO_FLOW, "warp_gain") == 1
    assert report.value(MODEL, "gyro_rre") is None
    assert report.settings["gyroscope of made.txt"] == "the recording has no gyroscope"
    assert report.counts["recordings"] == 2
    page = as_markdown(report)
    assert "## without truth" in page and "## depth" not in page


def test_classical_is_not_printed_twice(discs, recorded, camera):
    report = evaluate_without_truth([recorded(discs)], model="classical", camera=camera)
    assert list(report.rows) == [MODEL, baselines.ZERO_FLOW]


def test_no_recording_is_one_error():
    with pytest.raises(BadInput, match="no recording"):
        evaluate_without_truth([])
