"""Scores of hand-made predictions on the hand-made world."""

from dataclasses import replace

import numpy as np
import pytest
from pytest import approx

from evimo.evaluation.labels import labelled
from evimo.evaluation.ratios import Score, added
from evimo.evaluation.scores import (
    at_rest,
    depth_scale,
    depth_scores,
    event_label_scores,
    flow_scores,
    mask_scores,
    object_scores,
    prediction_scores,
    twist_scores,
)
from evimo.recordings.estimate import Estimate, MovingObject
from evimo.recordings.prediction import prediction_of


def value(scores, name):
    return scores[name].value


def test_scores_add_up_like_the_ratio_of_their_sums():
    total = added([{"a": Score(1, 2)}, {"a": Score(3, 2), "b": Score(1, 1)}, {}])
    assert total == {"a": Score(4, 4, 2), "b": Score(1, 1, 1)}
    assert Score(0, 0).value is None


def test_mask_scores_of_a_mask_shifted_by_one_column(sample, box):
    scores = mask_scores(box(1, 3, 2, 5), sample)  # the mover is 1, 3, 1, 4
    assert value(scores, "iou") == approx(4 / 8)
    assert value(scores, "iou_pooled") == approx(4 / 8)
    assert "iou_30px" not in scores  # the mover has 6 pixels
    assert value(scores, "event_iou") == approx(2 / 4)  # two of the four mover events, no other
    assert value(scores, "event_iou_frames") == approx(2 / 4)
    assert value(scores, "recall") == approx(2 / 3)  # pixels with events: (1, 1), (2, 1), (3, 2)
    assert value(scores, "recall_dense") == approx(4 / 6)
    assert "false_alarm_events" not in scores


def test_clutter_resting_and_other_background_are_told_apart(sample, box):
    scores = mask_scores(box(5, 6, 0, 8), sample)  # the last row: one clutter event pixel of two, the resting object
    assert value(scores, "clutter") == approx(1 / 2)
    assert value(scores, "resting") == approx(1)
    assert value(scores, "background") == approx(0)
    assert value(scores, "iou") == 0


def test_perfect_masks_score_one_and_touch_nothing_static(sample):
    scores = mask_scores(sample.moving, sample)
    ones = {"iou", "iou_pooled", "event_iou", "event_iou_frames", "recall", "recall_dense"}
    ones |= {"iou_area_3", "recall_area_3"}  # 6 of 48 pixels; too few to be detected, and nobody says how they flow
    assert {name for name, score in scores.items() if score.value == 1} == ones
    assert {name for name, score in scores.items() if score.value == 0} == {"clutter", "resting", "background"}


def test_events_are_asked_where_they_come_from_and_not_only_where_the_mask_is(sample):
    ids = np.array([1, 0, 1, 1, 1, 0, 2, 0, 0, 0], np.uint8)  # the second left its pixel's mask, the fifth is ahead
    known = replace(sample, event_ids=ids)
    called = np.array([1, 0, 0, 1, 1, 1, 0, 0, 0, 0], bool)
    scores = event_label_scores(called, known)
    assert value(scores, "event_iou") == approx(2 / 6)  # by the mask: events 0 to 3 move
    assert value(scores, "event_iou_own") == approx(3 / 5)  # by themselves: 0, 2, 3, 4; object 2 rests
    assert "event_iou_own" not in event_label_scores(called, sample)
    from_mask = mask_scores(sample.moving, known)
    assert value(from_mask, "event_iou") == 1
    assert value(from_mask, "event_iou_own") == approx(3 / 5)  # no still mask is right about every event


def test_false_alarms_are_counted_where_nothing_moves_and_only_there(still_sample, box):
    scores = mask_scores(box(0, 6, 0, 4), still_sample)
    assert value(scores, "false_alarm_events") == approx(2 / 4)
    assert value(scores, "false_alarm_pixels") == approx(24 / 48)
    assert "iou" not in scores and "event_iou_frames" not in scores
    assert scores["recall"] == Score(0, 0)
    assert scores["iou_pooled"] == Score(0, 24)


def test_pixels_that_are_not_scored_change_nothing(sample, box):
    part = labelled(sample.events, sample.truth, scored=box(0, 6, 0, 3), focal_px=(1, 1), dt_s=0.025)
    inside = mask_scores(box(0, 6, 0, 3), part)
    assert inside == mask_scores(box(0, 6, 0, 8), part)
    assert value(inside, "iou") == approx(4 / 18)


def test_flow_is_averaged_over_pixels_with_events_and_over_all(sample):
    seen = np.zeros((2, 6, 8))
    seen[0, :, :4] = 0.3  # right in x on the left half: there 40 px/s remain of 50
    scores = flow_scores(seen, sample)
    assert value(scores, "flow_dense") == approx(45)
    assert value(scores, "flow") == approx((4 * 40 + 5 * 50) / 9)  # pixels with events: 4 left, 5 right
    assert value(scores, "flow_movers") == approx(40)
    assert value(scores, "flow_ratio") == approx((4 * 40 + 5 * 50) / 9 / 50)
    assert value(scores, "flow_movers_ratio") == approx(40 / 50)


def test_flow_without_truth_or_events_is_not_scored(sample, still_sample):
    assert flow_scores(np.zeros((2, 6, 8)), still_sample) == {}
    empty = labelled(
        sample.events.part(0, 0), sample.truth, scored=sample.scored, focal_px=(1, 1), dt_s=0.025, flow=sample.flow
    )
    assert set(flow_scores(np.zeros((2, 6, 8)), empty)) == {"flow_dense"}


def test_twist_in_mean_depths_is_scaled_by_norm_or_by_depth(sample):
    metres = depth_scale(np.where(sample.truth.ids == 1, 0.5, 1.0), sample)
    assert metres == approx(2)
    scores = twist_scores(sample.truth.ego * [0.25, 0, 0.25, 1, 1, 1], sample, metres=metres)  # half as fast
    assert value(scores, "camera_aee") == approx(0)
    assert value(scores, "camera_aee_depth") == approx(0.25)
    assert value(scores, "aee_depth_ratio") == approx(0.5)
    assert value(scores, "camera_rre") == approx(0)
    assert value(scores, "direction") == approx(0)


def test_a_wrong_twist_scores_its_difference(sample):
    scores = twist_scores(np.array([-0.4, 0, -0.3, 0, 0, -0.1]), sample, metres=None)
    assert value(scores, "camera_aee") == approx(1.0)  # m/s: the opposite of 0.5 m/s
    assert value(scores, "aee_ratio") == approx(2)
    assert value(scores, "camera_rre") == approx(0.3)
    assert value(scores, "rre_ratio") == approx(1.5)
    assert value(scores, "direction") == approx(180)
    assert "camera_aee_depth" not in scores


@pytest.mark.parametrize(("speed_m_s", "scored"), [(0, False), (0.049, False), (0.051, True)])
def test_a_camera_slower_than_5_cm_per_second_is_at_rest_and_only_its_rotation_is_scored(sample, speed_m_s, scored):
    truth = replace(sample.truth, ego=np.array([0, 0, speed_m_s, 0, 0, 0.2]))
    slow = replace(sample, truth=truth)
    scores = twist_scores(np.array([0.1, 0, 0, 0, 0, 0.1]), slow, metres=1.0)
    translation = {"camera_aee", "aee_ratio", "camera_aee_depth", "aee_depth_ratio", "direction"}
    assert set(scores) == {"camera_rre", "rre_ratio"} | (translation if scored else set())
    assert value(scores, "rre_ratio") == approx(0.5)
    assert at_rest(slow) is not scored


def object_map(sample, velocity):
    return np.where(sample.moving[..., None], velocity, 0.0)


def test_convention_object_velocity_points_where_the_object_goes(big_sample):
    along, against = object_map(big_sample, [0, 0.1, 0]), object_map(big_sample, [0, -0.1, 0])
    assert value(object_scores(along, big_sample, metres=2.0), "object_aee") == approx(0)  # true: +0.2 m/s
    assert value(object_scores(along, big_sample, metres=2.0), "object_aee_depth") == approx(0)
    assert value(object_scores(against, big_sample, metres=2.0), "object_aee") == approx(0.4)


def test_an_object_of_which_nothing_is_predicted_errs_by_its_speed(big_sample):
    scores = object_scores(object_map(big_sample, [0, 0, 0]), big_sample, metres=2.0)
    assert value(scores, "object_aee") == approx(0.2)
    assert value(scores, "objects_found") == 0
    assert scores["object_aee"].samples == 1  # the resting one is no moving object


def test_velocity_is_averaged_inside_the_true_mask(big_sample):
    half = object_map(big_sample, [0, 0.1, 0])
    half[:, :20] = [0.1, 0, 0]  # the mover spans columns 10 to 29
    scores = object_scores(half, big_sample, metres=2.0)
    assert value(scores, "object_aee") == approx(2 * 0.2 * np.sin(np.deg2rad(45) / 2))
    assert value(scores, "object_aee_depth") == approx(np.hypot(0.1, 0.1))


def test_objects_under_30_pixels_are_not_scored(sample):
    assert object_scores(object_map(sample, [0, 0.1, 0]), sample, metres=1.0) == {}


def test_depth_is_scored_dense_and_at_events(sample):
    flat = depth_scores(np.ones((6, 8)), sample)  # the truth: 2 m, and 1 m on the 6 pixels of the mover
    assert value(flat, "abs_rel") == approx(6 / 48)
    assert value(flat, "abs_rel_events") == approx(3 / 9)
    assert value(flat, "delta_1") == approx(42 / 48)
    assert value(depth_scores(sample.truth.depth * 3, sample), "abs_rel") == approx(0, abs=1e-6)


def test_a_perfect_estimate_is_perfect_in_every_column(big_sample):
    truth = big_sample.truth
    found = MovingObject(7, (10, 10, 29, 29), 400, (19.5, 19.5), 0.5, truth.objects[1].velocity / 2)
    estimate = Estimate(
        t_us=12_500,
        start_us=0,
        stop_us=25_000,
        moving_probability=big_sample.moving.astype(np.float32),
        ids=np.where(big_sample.moving, 7, 0).astype(np.uint8),
        rel_depth=truth.depth / 2,
        flow=big_sample.flow,
        confidence=np.ones_like(big_sample.flow[0]),
        valid=big_sample.scored,
        ego=truth.ego * [0.5, 0.5, 0.5, 1, 1, 1],
        objects=(found,),
    )
    scores = {name: score.value for name, score in prediction_scores(prediction_of(estimate), big_sample).items()}
    best = {"iou", "event_iou", "recall", "detected", "objects_found", "delta_1", "delta_2", "delta_3"}
    for name, number in scores.items():
        assert number == approx(1 if name.startswith(tuple(best)) else 0, abs=1e-6), name
