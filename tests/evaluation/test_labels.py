"""What counts as moving, and which events and pixels are scored."""

import numpy as np
import pytest

from evimo.evaluation.labels import labelled
from evimo.recordings.truth import ObjectTruth


@pytest.mark.parametrize(
    ("speed_m_s", "turning_deg_s", "moving"), [(0, 0, False), (0.029, 9, False), (0.031, 0, True), (0, 11, True)]
)
def test_convention_moving_is_faster_than_3_cm_or_10_degrees_per_second(speed_m_s, turning_deg_s, moving):
    body = ObjectTruth(np.zeros(3), np.array([0, 0, -speed_m_s]), np.array([np.deg2rad(turning_deg_s), 0, 0]))
    assert body.moves is moving


def test_resting_objects_are_background(sample, still_sample, box):
    assert (sample.moving == box(1, 3, 1, 4)).all()
    assert (sample.resting == box(5, 6, 0, 2)).all()
    assert not still_sample.moving.any()
    assert np.count_nonzero(still_sample.resting) == 6 + 2


def test_active_pixels_are_those_with_events_however_many(sample):
    assert len(sample.events) == 10
    assert np.count_nonzero(sample.active) == 9


def test_events_on_pixels_outside_the_rectified_image_are_left_out(sample, box):
    ids = np.arange(10, dtype=np.uint8)  # as good a name as any for each event
    part = labelled(sample.events, sample.truth, scored=box(0, 6, 0, 4), focal_px=(1, 1), dt_s=0.025, event_ids=ids)
    assert len(part.events) == 5
    assert part.event_ids.tolist() == ids[part.kept].tolist() == [0, 1, 2, 3, 6]  # columns 0 to 3
    assert not part.active[:, 4:].any()


def test_an_id_without_motion_of_its_own_is_background(sample):
    truth = sample.truth
    truth.objects.clear()
    assert not truth.of_movers(truth.ids).any()
