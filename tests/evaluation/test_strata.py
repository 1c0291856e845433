"""Scores by what movers are like, on a world of 4,000 pixels whose movers have 200, 36 and 10."""

import numpy as np
import pytest
from pytest import approx

from evimo.evaluation.columns import BY_NAME
from evimo.evaluation.labels import LabelledSlice, Residual, labelled
from evimo.evaluation.pixel_classes import PixelClasses
from evimo.evaluation.strata import AREAS, RESIDUALS, detection_scores, mover_scores, strata_of
from evimo.evaluation.tables import header
from evimo.events.events import Events
from evimo.recordings.truth import ObjectTruth, Truth

SIZE = (40, 100)
LARGE, SMALL, TINY = (slice(5, 15), slice(10, 30)), (slice(20, 26), slice(10, 16)), (slice(30, 32), slice(10, 15))


def mask(*boxes) -> np.ndarray:
    drawn = np.zeros(SIZE, bool)
    for box in boxes:
        drawn[box] = True
    return drawn


@pytest.fixture
def world() -> LabelledSlice:
    """Object 1 (5 %) differs by 3 px per slice, 2 (0.9 %) by 0.5, of 3 (0.25 %) no depth is known; 4 (5 %) rests.

    An event in every pixel of the left half. Training has seen the families of 1 and 3.
    """
    ids = np.zeros(SIZE, np.uint8)
    for key, box in enumerate((LARGE, SMALL, TINY, (slice(5, 15), slice(60, 80))), 1):
        ids[box] = key
    speeds = {1: 0.5, 2: 0.1, 3: 0.1, 4: 0.0}
    objects = {key: ObjectTruth(np.zeros(3), np.array([speed, 0, 0]), np.zeros(3)) for key, speed in speeds.items()}
    truth = Truth(0, np.ones(SIZE, np.float32), ids != 3, ids, np.zeros(SIZE, bool), np.zeros(6), objects)
    residual = np.where(ids == 1, 3.0, np.where(ids == 2, 0.5, 0)).astype(np.float32)
    residual[5, 10:30] = 90  # a tenth of the large one: the median does not care
    y, x = (each.ravel().astype(np.uint16) for each in np.mgrid[:40, :50])
    events = Events(x, y, np.zeros(2000, np.int64), np.ones(2000, np.int8))
    return labelled(
        events,
        truth,
        scored=np.ones(SIZE, bool),
        focal_px=(1, 1),
        dt_s=0.025,
        residual=Residual(residual, residual, ids != 3),
        familiar={1: True, 2: False, 3: True},
    )


def values(scores):
    return {name: score.value for name, score in scores.items()}


def test_movers_know_their_size_motion_and_family(world):
    large, small, tiny = world.movers  # the fourth rests
    assert (large.id, large.area_px, large.active_px, large.area) == (1, 200, 200, 0.05)
    assert large.residual_px == 3.0
    assert small.area == 0.009
    assert tiny.residual_px is None
    assert list(strata_of(large)) == ["residual_3", "area_3", "familiar"]
    assert list(strata_of(small)) == ["residual_1", "area_1", "unfamiliar"]  # intervals hold their lower edge
    assert list(strata_of(tiny)) == ["area_0", "familiar"]


def test_tables_say_what_the_strata_hold():
    assert list(RESIDUALS.values()) == ["<0.5 px", "0.5–1 px", "1–2 px", "2–4 px", "≥4 px"]
    assert list(AREAS.values()) == ["<0.3 %", "0.3–1 %", "1–3 %", "≥3 %"]
    assert header(BY_NAME["iou_residual_1"]) == "IoU 0.5–1 px ↑"


def test_other_movers_are_left_out_of_the_iou_of_a_stratum(world):
    called = mask((slice(5, 15), slice(20, 30)), SMALL, (slice(36, 40), slice(90, 100)))  # half of 1; 2; 40 static
    scores = values(mover_scores(called, world, PixelClasses(world).count(called)))
    assert scores["iou_area_3"] == scores["iou_residual_3"] == approx(100 / (200 + 40))
    assert scores["iou_area_1"] == scores["iou_residual_1"] == scores["iou_unfamiliar"] == approx(36 / (36 + 40))
    assert scores["iou_area_0"] == 0
    assert scores["iou_familiar"] == approx(100 / (200 + 10 + 40))
    assert scores["recall_area_3"] == 0.5
    assert scores["recall_familiar"] == approx(100 / 210)
    assert "iou_residual_0" not in scores and "iou_area_2" not in scores


@pytest.mark.parametrize(
    ("called", "detected"),
    [
        (mask(LARGE), True),
        (mask((slice(5, 15), slice(10, 20))), False),  # a half is not more than half
        (mask((slice(5, 15), slice(10, 21))), True),
        (mask((slice(5, 15), slice(19, 49))), False),  # 110 on it, 190 off it
        (mask((slice(5, 15), slice(19, 40))), True),  # 110 on it, 100 off it
        (mask((slice(5, 15), slice(10, 16)), (slice(5, 15), slice(20, 26))), True),  # two regions of 60, both its own
        (mask((slice(5, 15), slice(10, 16)), (slice(5, 15), slice(20, 45))), False),  # the second lies more off it
        (mask(LARGE, (slice(36, 40), slice(0, 100))), True),  # a false alarm elsewhere is not its fault
        (np.ones(SIZE, bool), False),
        (np.zeros(SIZE, bool), False),
    ],
)
def test_convention_detected_is_more_than_half_by_regions_that_lie_more_on_it_than_off_it(world, called, detected):
    assert detection_scores(called, world)["detected_area_3"].value == detected


def test_regions_that_touch_at_a_corner_are_one(world):
    touching = mask((slice(5, 15), slice(10, 22)), (slice(15, 40), slice(22, 40)))
    apart = mask((slice(5, 15), slice(10, 22)), (slice(16, 40), slice(22, 40)))
    assert detection_scores(touching, world)["detected_area_3"].value == 0
    assert detection_scores(apart, world)["detected_area_3"].value == 1


def test_what_covers_two_movers_detects_the_one_that_it_lies_on_most(world):
    bridge = (slice(15, 20), slice(10, 11))
    scores = detection_scores(mask(LARGE, bridge, SMALL), world)
    assert (scores["detected_area_3"].value, scores["detected_area_1"].value) == (1, 0)


def test_movers_under_30_pixels_are_not_asked_for(world):
    scores = detection_scores(world.moving, world)
    assert scores["detected"].samples == 2
    assert "detected_area_0" not in scores
    assert values(scores)["detected"] == 1
