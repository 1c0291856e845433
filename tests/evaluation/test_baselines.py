"""The trivial answers on frames made by hand."""

import numpy as np
import pytest
from pytest import approx

from evimo.evaluation import baselines
from evimo.evaluation.labels import labelled
from evimo.evaluation.ratios import added
from evimo.evaluation.scores import mask_scores
from evimo.events.events import Events, no_events


def crowded(columns: range, size=(40, 40)) -> Events:
    """Ten events on each pixel of those columns, one on every other pixel."""
    x, y = np.meshgrid(np.arange(size[1]), np.arange(size[0]))
    times = np.where(np.isin(x, list(columns)), 10, 1).ravel()
    x, y = np.repeat(x.ravel(), times), np.repeat(y.ravel(), times)
    return Events(x.astype(np.uint16), y.astype(np.uint16), np.zeros(len(x), np.int64), np.ones(len(x), np.int8))


def test_even_events_have_density_one_up_to_the_border():
    assert baselines.event_density(crowded(range(0)), (40, 40)) == approx(np.ones((40, 40)), rel=1e-4)


def test_density_is_relative_to_the_frame():
    density = baselines.event_density(crowded(range(20)), (40, 40))
    assert density[20, 3] == approx(10 / 5.5, rel=1e-4)
    assert density[20, 36] == approx(1 / 5.5, rel=1e-4)


def test_density_of_no_events_is_zero():
    assert not baselines.event_density(no_events(), (5, 7)).any()


@pytest.mark.parametrize(("width", "side"), [(12, 1), (26, 3), (39, 3), (52, 5), (78, 7), (346, 27)])
def test_the_box_is_a_13th_of_the_width_and_one_more_where_that_is_even(width, side):
    centre = Events(
        *(np.array([value], kind) for value, kind in ((width // 2, "u2"), (20, "u2"), (0, "i8"), (1, "i1")))
    )
    density = baselines.event_density(centre, (41, width))
    assert np.count_nonzero(density[20] > 1e-3) == side


def test_threshold_is_tuned_to_where_the_crowd_is(big_sample):
    sample = labelled(crowded(range(10, 30)), big_sample.truth, scored=big_sample.scored, focal_px=(1, 1), dt_s=0.025)
    best = baselines.tune_density_threshold([sample, sample])
    by_hand = {
        each: mask_scores(baselines.event_density(sample.events, (40, 40)) > each, sample)["iou"].value
        for each in baselines.THRESHOLDS
    }
    assert by_hand[best] == max(by_hand.values()) > 0.45  # the crowd spans all rows, the mover half of them


def test_best_threshold_of_nothing_scored_is_the_lowest():
    assert baselines.best_threshold({2.0: {}, 1.0: {}}) == 1.0


def test_trivial_answers_score_what_they_must(sample):
    rows = baselines.trivial_scores(sample)
    background, everything = rows[baselines.ALL_BACKGROUND], rows[baselines.EVERYTHING]
    assert (background["iou"].value, everything["iou"].value) == (0, approx(6 / 48))
    assert (background["recall"].value, everything["recall"].value) == (0, 1)
    assert (background["clutter"].value, everything["clutter"].value) == (0, 1)
    assert everything["event_iou"].value == approx(4 / 10)
    assert rows[baselines.CONSTANT_DEPTH]["abs_rel"].value == approx(6 / 48)
    assert rows[baselines.ZERO_FLOW]["flow"].value == approx(50)
    assert rows[baselines.ZERO_FLOW]["flow_ratio"].value == approx(1)


def test_zero_twist_errs_by_the_true_motion(big_sample):
    scores = baselines.trivial_scores(big_sample)[baselines.ZERO_TWIST]
    assert scores["camera_aee"].value == approx(0.5)
    assert scores["camera_rre"].value == approx(0.2)
    assert (scores["aee_ratio"].value, scores["rre_ratio"].value) == (approx(1), approx(1))
    assert scores["direction"].value == approx(90)
    assert scores["object_aee"].value == approx(0.2)


def test_the_oracle_is_at_least_as_good_as_any_threshold(big_sample):
    scores = baselines.density_scores(big_sample, baselines.THRESHOLDS)
    doubled = {key: added((each, each)) for key, each in scores.items()}
    best = baselines.best_threshold(doubled)
    assert all(doubled[best]["iou"].value >= each["iou"].value for each in scores.values())


@pytest.mark.parametrize("threshold", [baselines.DENSITY_THRESHOLD])
def test_the_shipped_threshold_lies_within_the_range_searched(threshold):
    assert min(baselines.THRESHOLDS) < threshold < max(baselines.THRESHOLDS)
