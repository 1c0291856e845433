import numpy as np
import pytest
from pytest import approx

from evimo.events.slices import Slice
from evimo.recordings.truth import ObjectTruth, Truth
from evimo.viewing.moment import estimated, true

SIZE = (20, 30)


def truth_of(ids, **objects):
    moved = {
        int(name[1:]): ObjectTruth(np.zeros(3), np.array(v, float), np.array(w, float))
        for name, (v, w) in objects.items()
    }
    known = np.ones(SIZE, bool)
    return Truth(12_500, np.ones(SIZE, np.float32), known, ids, ~known, np.arange(6.0), moved)


@pytest.fixture
def part(make_events):
    return Slice(0, 0, 25_000, make_events((3, 4, 1)))


def test_unknown_velocities_of_estimates_are_zero(make_estimate, make_square):
    moment = estimated(make_estimate(SIZE, make_square(2, (3, 4, 8, 9), (np.nan, 1, 0)), ego=np.full(6, np.nan)))
    assert moment.ego.tolist() == [0] * 6
    assert moment.marks[0].velocity.tolist() == [0, 1, 0]
    assert moment.headline == "1 moving object"


def test_marks_of_truth_are_where_the_ids_are(part):
    ids = np.zeros(SIZE, np.uint8)
    ids[5:8, 10:21] = 2
    moment = true(truth_of(ids, o2=((1, 2, 3), (0, 0, 0))), part)
    (mark,) = moment.marks
    assert (mark.id, mark.box) == (2, (10, 5, 20, 7))
    assert mark.centroid == approx((15, 6))
    assert mark.velocity.tolist() == [1, 2, 3]
    assert (moment.t_us, moment.start_us, moment.stop_us) == (12_500, 0, 25_000)


def test_objects_out_of_view_have_no_mark_and_resting_ones_are_counted(part):
    ids = np.zeros(SIZE, np.uint8)
    ids[0, 0], ids[1, 1], ids[2, 2], ids[3, 3] = 1, 2, 4, 5
    still, moving, turning = ((0, 0, 0), (0, 0, 0)), ((0, 0, 1), (0, 0, 0)), ((0, 0, 0), (0, 1, 0))
    creeping = ((0.02, 0, 0), (0, 0.1, 0))
    truth = truth_of(ids, o1=still, o2=moving, o3=moving, o4=turning, o5=creeping)
    moment = true(truth, part)
    assert [mark.id for mark in moment.marks] == [1, 2, 4, 5]
    assert moment.headline == "4 objects in view, 2 at rest"  # as training and evaluation have it
    assert truth.movers == [2, 3, 4]
