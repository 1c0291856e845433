"""Curves against what can be counted by hand, and sums that survive being kept and added."""

import json
from dataclasses import replace

import numpy as np
import pytest
from pytest import approx

from evimo.benchmark import curves
from evimo.benchmark.curves import DEPTH, LEVELS, PRECISION, RECALL, SPEED, TURNING, curves_of, mask_curves
from evimo.benchmark.scoring import TRIVIAL, tallies_of
from evimo.benchmark.tables import LAYOUTS, Block, Row
from evimo.benchmark.tally import FrameScore, Tally, tally_from
from evimo.evaluation.columns import BY_NAME
from evimo.evaluation.ratios import Score
from evimo.evaluation.scoring import labelled_slices
from evimo.recordings.prediction import Prediction
from evimo.recordings.recording import open_recording


@pytest.fixture
def sample(saved, tmp_path):
    return next(labelled_slices(open_recording(saved(tmp_path / "wall", background="wall"))))


def test_precision_and_recall_are_those_of_each_threshold(sample):
    rng = np.random.default_rng(0)
    probability = np.clip(rng.random(sample.scored.shape) + 0.2 * sample.moving, 0, 1).astype(np.float32)
    probability[0, :3] = 0, 0.5, 1  # at a threshold itself is not above it
    curves = mask_curves(probability, sample)
    for k in (0, 1, 12, LEVELS // 2, LEVELS - 1):
        called = probability > np.float32(k / LEVELS)
        hits = np.count_nonzero(called & sample.moving)
        assert curves[PRECISION][str(k)] == Score(hits, np.count_nonzero(called))
        assert curves[RECALL][str(k)] == Score(hits, 100)
    assert set(curves[PRECISION]) == {str(k) for k in range(LEVELS)}


def test_depth_error_is_sorted_by_true_depth(sample):
    curve = curves_of(Prediction(rel_depth=np.ones(sample.scored.shape)), sample)[DEPTH]
    assert {name: (score.value, score.bottom) for name, score in curve.items()} == {
        "3": (approx(1.0), 100),  # 0.9 to 1.2 m: 2 m is said where it is 1 m
        "5": (approx(0.0), 1100),  # 1.6 to 2.2 m
    }


def test_motion_errors_are_sorted_by_how_fast_the_camera_is(sample):
    ego = np.array([0.1, 0, 0.2, 0, 0, 0])
    curves = curves_of(Prediction(ego=ego, rel_depth=np.ones(sample.scored.shape)), sample)
    assert {name: score.value for name, score in curves[TURNING].items()} == {"2": approx(0.2)}  # 0.2 to 0.4 rad/s
    assert {name: score.value for name, score in curves[SPEED].items()} == {"3": approx(np.hypot(0.1, 0))}  # 0.5 m/s
    assert SPEED not in curves_of(Prediction(ego=ego), sample)


def test_no_pixel_and_no_slice_lies_beyond_the_curves(sample):
    """Depths of 0.1 and 20 m, and a camera at 5 m/s that turns by 9 rad/s, are in the first and the last bins."""
    depth = sample.truth.depth.copy()
    depth[0], depth[1] = 0.1, 20.0
    fast = replace(sample.truth, depth=depth, ego=np.array([3.0, 0, 4, 9, 0, 0]))
    ones = np.ones(sample.scored.shape)
    curves = curves_of(Prediction(ego=np.zeros(6), rel_depth=ones), replace(sample, truth=fast))
    counts = {name: score.bottom for name, score in curves[DEPTH].items()}
    assert counts == {"0": 40, "3": 100, "5": 1200 - 180, "7": 40}
    assert {name: score.value for name, score in curves[TURNING].items()} == {"7": approx(9)}
    assert {name: score.value for name, score in curves[SPEED].items()} == {"6": approx(5)}


def test_tallies_add_up_and_come_back_from_json(saved, tmp_path):
    ticks = []
    recording = open_recording(saved(tmp_path / "wall", background="wall"))
    tally = tallies_of(recording, {TRIVIAL: ""}, lambda: ticks.append(1))[TRIVIAL]
    assert tally.counts["slices"] == len(ticks) == 4
    tally = tally + Tally(frames=[FrameScore(25_000, 0.5, 60)])
    again = tally_from(json.loads(json.dumps(tally.as_dict())))
    assert again.rows == tally.rows and again.curves == tally.curves and list(again.frames) == list(tally.frames)
    twice = again + tally
    assert twice.counts["slices"] == 8
    assert twice.rows["everything moves"]["iou"].value == approx(100 / 1200)


@pytest.mark.parametrize(
    ("models", "trivial", "better", "best"),
    [
        ((0.3, 0.2), 0.4, "iou", set()),
        ((0.3, 0.2), 0.3, "iou", set()),
        ((0.3, 0.2), 0.1, "iou", {"a"}),
        ((0.3, 0.3), 0.1, "iou", {"a", "b"}),
        ((0.3002, 0.3004), 0.1, "iou", {"a", "b"}),  # printed alike
        ((0.3004, 0.2), 0.3, "iou", set()),
        ((0.3, 0.2), 0.4, "abs_rel", {"b"}),
        ((0.3, 0.2), 0.2, "abs_rel", set()),
    ],
)
def test_the_best_model_is_marked_where_it_beats_the_trivial_answers(models, trivial, better, best):
    rows = [Row(name, "model", {better: Score(value, 1)}) for name, value in zip("ab", models, strict=True)]
    rows += [Row("nothing", "trivial", {better: Score(trivial, 1)}), Row("truth", "ceiling", {better: Score(0.9, 1)})]
    assert Block("wall", "wall", tuple(rows)).best(BY_NAME[better]) == best


def test_every_column_of_the_tables_has_a_definition():
    assert all(name in BY_NAME for layout in LAYOUTS for name in layout.columns)


def test_a_speed_that_is_no_number_is_in_no_bin():
    assert curves._in_bin(float("nan"), curves.SPEED_EDGES, 1.0) == {}
    assert list(curves._in_bin(9.0, curves.SPEED_EDGES, 1.0)) == [str(len(curves.SPEED_EDGES) - 2)]
