"""Published protocols on masks whose scores can be counted by hand."""

import math

import numpy as np
import pytest
from pytest import approx

from evimo.evaluation.columns import PROTOCOLS, SECTIONS
from evimo.evaluation.instances import Identities, connected, instances_of, overlaps
from evimo.evaluation.labels import labelled
from evimo.evaluation.outlines import box_px, hulls, shared_box
from evimo.evaluation.protocol_scores import Protocols, event_scores, halved, whole_mask_scores
from evimo.evaluation.ranked import Ranked, precisions, ranked_detections, ranked_from
from evimo.events.events import Events
from evimo.recordings.prediction import Prediction
from evimo.recordings.truth import ObjectTruth, Truth

SIZE = (40, 40)
EVERYWHERE = np.ones(SIZE, bool)
MOTION = ObjectTruth(np.array([0, 0, 1.0]), np.array([0, 0.2, 0]), np.zeros(3))


def events_at(x, y, t_us=12_500) -> Events:
    x, y = np.asarray(x), np.asarray(y)
    t = np.broadcast_to(np.asarray(t_us, np.int64), x.shape)
    return Events(x.astype(np.uint16), y.astype(np.uint16), t, np.ones(len(x), np.int8))


def slice_with(ids, events=None, *, scored=EVERYWHERE):
    movers = {int(key): MOTION for key in np.unique(ids[ids > 0])}
    truth = Truth(12_500, np.ones(SIZE, np.float32), EVERYWHERE, ids, ~EVERYWHERE, np.zeros(6), movers)
    events = events_at([], []) if events is None else events
    return labelled(events, truth, scored=scored, focal_px=(50.0, 50.0), dt_s=0.025)


def boxes(*places: tuple[int, int, int, int]) -> np.ndarray:
    """Ids 1, 2, … in rows y0 to y1 and columns x0 to x1, ends excluded."""
    ids = np.zeros(SIZE, np.uint8)
    for name, (y0, y1, x0, x1) in enumerate(places, 1):
        ids[y0:y1, x0:x1] = name
    return ids


def scores_of(predicted, ids, events=None, *, named=True):
    what = Prediction(moving=predicted > 0, ids=predicted.astype(np.int32) if named else None)
    return Protocols().of_maps(what, slice_with(ids, events)).scores


def test_frames_in_which_nothing_moves_are_right_if_nothing_is_called_moving():
    nothing = np.zeros(SIZE, bool)
    scores = whole_mask_scores(nothing, nothing, EVERYWHERE)
    assert {name: score.value for name, score in scores.items()} == {"iou_all_frames": 1, "detected_mask": 1}
    scores = whole_mask_scores(~nothing, nothing, EVERYWHERE)
    assert {name: score.value for name, score in scores.items()} == {"iou_all_frames": 0, "detected_mask": 0}


def test_a_whole_mask_is_detected_from_one_half_on():
    true = boxes((0, 10, 0, 10)) > 0
    for columns, found in ((5, 1), (4, 0), (20, 1), (21, 0)):  # 20: IoU one half, as many false pixels as right ones
        mask = boxes((0, 10, 0, columns)) > 0
        assert whole_mask_scores(mask, true, EVERYWHERE)["detected_mask"].value == found, columns


def test_class_mean_is_the_mean_of_both_classes():
    true, mask = boxes((0, 10, 0, 10)) > 0, boxes((0, 10, 5, 15)) > 0
    assert whole_mask_scores(mask, true, EVERYWHERE)["iou_classes"].value == approx((50 / 150 + 1450 / 1550) / 2)
    assert whole_mask_scores(EVERYWHERE, EVERYWHERE, EVERYWHERE)["iou_classes"].value == 1  # there is no background


def test_half_size_takes_blocks_of_which_half_is_in_the_mask():
    mask, scored = np.zeros((5, 7), bool), np.ones((5, 7), bool)
    mask[0, 0] = True  # a quarter of its block
    mask[0:2, 2] = True  # half
    mask[2:, 4:] = True
    assert halved(mask, scored).tolist() == [[False, True, False], [False, False, True]]
    scored[1, 0:2], scored[2:4, 0:2] = False, False
    assert halved(mask, scored).tolist() == [[True, True, False], [False, False, True]]


def test_a_box_may_be_found_where_the_region_is_not_and_the_other_way_round():
    ids = boxes((10, 20, 10, 20))
    frame = ids.copy()
    frame[11:19, 11:19] = 0  # its outline: 36 of 100 pixels
    scores = scores_of(frame, ids)
    assert (scores["detected_box"].value, scores["detected_box_iou"].value, scores["detected_region"].value) == (
        1,
        1,
        0,
    )
    stained = ids.copy()
    stained[39, 39] = 1  # one pixel far away
    scores = scores_of(stained, ids)
    assert (scores["detected_box"].value, scores["detected_box_iou"].value, scores["detected_region"].value) == (
        0,
        0,
        1,
    )
    assert scores_of(stained, ids, named=False)["detected_box"].value == 1  # two regions, one of them right


def test_a_box_of_half_the_true_one_is_not_found_and_a_little_more_is():
    ids = boxes((10, 20, 10, 20))
    for columns, found in ((5, 0), (6, 1)):
        scores = scores_of(boxes((10, 20, 10, 10 + columns)), ids)
        assert (
            scores["detected_box"].value == scores["detected_box_iou"].value == scores["detected_region"].value == found
        )
    wide = boxes((10, 20, 10, 29))  # all of it, and 90 of 190 off it: IoU 0.53
    assert scores_of(wide, ids)["detected_box"].value == scores_of(wide, ids)["detected_box_iou"].value == 1
    partly = boxes((14, 21, 10, 20))  # 60 of 100, 10 off it: more than half of the true box, IoU 0.55
    assert scores_of(partly, ids)["detected_box_iou"].value == 1
    aside = boxes((14, 24, 10, 20))  # 60 of 100, 40 off it: IoU 0.43
    assert scores_of(aside, ids)["detected_box"].value == 1 and scores_of(aside, ids)["detected_box_iou"].value == 0


def test_boxes_that_do_not_meet_share_nothing():
    assert box_px(shared_box((0, 0, 3, 3), (4, 4, 9, 9))) == 0
    assert box_px(shared_box((0, 0, 3, 3), (3, 3, 9, 9))) == 1


def test_movers_below_30_pixels_are_neither_asked_for_nor_held_against_who_finds_them():
    ids = boxes((0, 5, 0, 5), (10, 20, 10, 20))
    assert scores_of(ids, ids)["detected_box"].bottom == 1
    pairs = overlaps(instances_of(ids.astype(np.int32), None, EVERYWHERE), slice_with(ids))
    ranked = ranked_detections(pairs, moving_px=125)
    assert (ranked.movers, ranked.movers_large) == (1, 0)
    assert ranked.scores()["ap"].value == approx(1) and "ap_evinsmos" not in ranked.scores()
    assert "instance_iou" not in scores_of(ids, boxes((0, 5, 0, 5)))


def test_event_pixels_count_once_however_many_events_they_have():
    ids = boxes((10, 20, 10, 20))
    events = events_at([10, 10, 10, 11, 30, 31], [10, 10, 10, 10, 30, 30])
    called = np.array([True, False, True, False, True, False])
    scores = event_scores(called, slice_with(ids, events))
    assert scores["iou_event_pixels"].value == approx(1 / 3)  # (10, 10) of (10, 10), (11, 10), (30, 30)


def test_spikems_keeps_slices_by_the_ratio_of_events_within_its_window():
    ids = boxes((10, 20, 10, 20))
    on, off = [10, 11, 21], [30, 31, 32, 33, 34]  # column 21 is in the dilated mask
    times = np.array([12_500] * 3 + [12_500] * 4 + [2_499])  # the last one is too early
    events = events_at(on + off, [15] * 8, times)
    called = np.isin(events.x, (10, 11, 30, 34))
    scores = event_scores(called, slice_with(ids, events))
    assert scores["spikems_kept_1.5"].value == 1 and scores["iou_spikems_1.5"].value == approx(2 / 4)
    more = events_at(on + off, [15] * 8)
    scores = event_scores(called, slice_with(ids, more))
    assert scores["spikems_kept_1.5"].value == 0 and "iou_spikems_1.5" not in scores  # 5 off, 3 on
    assert scores["spikems_kept_3"].value == 1 and scores["iou_spikems_3"].value == approx(2 / 5)
    small = event_scores(called, slice_with(boxes((15, 16, 10, 12)), events))
    assert small["spikems_kept_3"].value == 0  # two pixels


def test_hulls_fill_what_events_surround():
    corners = events_at([10, 19, 10, 19, 5], [10, 10, 19, 19, 30])
    assert np.count_nonzero(hulls(corners.x, corners.y, np.array([1, 1, 1, 1, 0]), SIZE)) == 100
    two = hulls(corners.x, corners.y, np.array([1, 1, 2, 2, 3]), SIZE)
    assert np.count_nonzero(two) == 10 + 10 + 1  # two lines and a point
    assert not hulls(corners.x[:0], corners.y[:0], np.zeros(0, np.int64), SIZE).any()
    ids = boxes((10, 20, 10, 20))
    labels = np.array([7, 7, 7, 7, 0])
    assert Protocols().of_events(labels, slice_with(ids, corners))["iou_hulls"].value == 1
    one_wrong = Protocols().of_events(np.full(5, 7), slice_with(ids, corners))["iou_hulls"].value
    assert one_wrong is not None and 0.3 < one_wrong < 0.7  # a single false event spoils a hull


def test_what_lies_outside_the_scored_pixels_is_no_part_of_any_object():
    ids = boxes((10, 20, 10, 20))
    scored = EVERYWHERE.copy()
    scored[:, 15:] = False
    sample = slice_with(ids, scored=scored)
    found = instances_of(boxes((10, 20, 10, 15)).astype(np.int32), None, scored)
    assert overlaps(found, sample).iou.tolist() == [[1.0]]
    assert overlaps(connected(ids > 0, None, scored), sample).iou.tolist() == [[1.0]]


def test_names_are_followed_over_slices_in_which_a_mover_is_not_found():
    ids = boxes((10, 20, 10, 20))
    sample, identities = slice_with(ids), Identities()
    switches = []
    for name in (3, 0, 3, 0, 5, 5, 3):
        scores = identities.scores(overlaps(instances_of(ids.astype(np.int32) * name, None, EVERYWHERE), sample))
        switches.append(scores["identity_switches"].top if scores else None)
    assert switches == [0, None, 0, None, 1, 0, 1]


def test_the_best_30_percent_are_rounded_up_and_precision_needs_movers():
    ranked = Ranked(frame_iou=(0.1, 0.9, 0.5, 0.7))
    assert ranked.scores()["iou_best30"].value == approx((0.9 + 0.7) / 2)
    assert ranked.scores().keys() == {"iou_best30"}
    assert Ranked(movers=3).scores()["ap"].value == 0
    assert ranked_from((ranked + Ranked(detections=((0.5, 3),), movers=1)).plain()).detections == ((0.5, 3),)


def test_average_precision_of_a_right_answer_after_a_wrong_one_is_one_half():
    assert precisions([(0.9, 0), (0.8, 0x3FF)], 1) == approx(np.full(10, 0.5))
    assert precisions([(0.8, 0), (0.9, 0x3FF)], 1) == approx(np.ones(10))
    half_found = precisions([(0.9, 0x3FF)], 2)
    assert half_found == approx(np.full(10, 51 / 101))  # recalls 0 to 0.5


def test_slices_with_few_moving_pixels_do_not_count_for_evinsmos():
    small, large = boxes((10, 20, 10, 20)), boxes((0, 30, 0, 30))
    total = Ranked()
    for ids, predicted in ((small, 0 * small), (large, large)):
        pairs = overlaps(instances_of(predicted.astype(np.int32), None, EVERYWHERE), slice_with(ids))
        total = total + ranked_detections(pairs, moving_px=int(np.count_nonzero(ids)))
    assert total.scores()["ap_evinsmos"].value == approx(1)
    assert total.scores()["ap"].value == approx(51 / 101)


def test_a_mask_of_noise_is_scored_in_no_time():
    rng = np.random.default_rng(0)
    noise = rng.random(SIZE) < 0.2
    scores = Protocols().of_maps(Prediction(moving=noise), slice_with(boxes((10, 20, 10, 20)))).scores
    assert scores["detected_region"].value == 0


def test_every_protocol_is_scored_by_a_true_mask_with_a_name_that_is_its_own():
    assert len({protocol.name for protocol in PROTOCOLS}) == len(PROTOCOLS) == len(SECTIONS["published protocols"])
    ids = boxes((10, 35, 10, 35))
    rows, columns = np.nonzero(ids)
    result = Protocols().of_maps(
        Prediction(moving=ids > 0, ids=ids.astype(np.int32)), slice_with(ids, events_at(columns, rows))
    )
    found = {name: score.value for name, score in (result.scores | result.ranked.scores()).items()}
    existing = {"iou", "iou_30px", "iou_pooled", "event_iou", "event_iou_frames", "event_iou_own"}
    assert set(found) == {protocol.column.name for protocol in PROTOCOLS} - existing
    assert {name for name, value in found.items() if not math.isclose(value or 0, 1)} == {"identity_switches"}


@pytest.mark.parametrize("saved", [{}, {"frame_iou": 3}, {"frame_iou": [], "detections": [[1]], "movers": 0}])
def test_damaged_ranked_scores_are_an_error(saved):
    from evimo.errors import BadInput

    with pytest.raises(BadInput):
        ranked_from(saved)
