"""Event IoU against a circle that moves within a slice."""

import numpy as np
import pytest
from pytest import approx

from evimo.errors import BadFile, NotFound
from evimo.evaluation import baselines
from evimo.evaluation.circles import Circles, added_rows, circle_scores, event_scores, load_circles
from evimo.events.events import Events, joined
from evimo.events.slices import Slice, in_slices
from evimo.formats import open_events

# A circle of radius 2 (5 with the margin) that moves 1000 px/s to the right: 25 px within a slice.
MOVING = Circles(np.array([0.0, 0.1]), np.array([20.0, 120.0]), np.array([20.0, 20.0]), np.array([2.0, 2.0]))
FIRST_US = 1_000_000


def row_of_events(x: list[int], t_us: int) -> Events:
    n = len(x)
    return Events(np.array(x, np.uint16), np.full(n, 20, np.uint16), np.full(n, FIRST_US + t_us), np.ones(n, np.int8))


def test_truth_is_the_circle_at_the_events_own_time():
    events = joined(
        [row_of_events([20, 25, 26], 0), row_of_events([44, 45], 24_000)]
    )  # the circle is at 20, then at 44
    part = Slice(40, FIRST_US, FIRST_US + 25_000, events)
    scores = circle_scores(part, np.ones((40, 60), bool), MOVING, first_us=FIRST_US)
    assert scores["everything moves"]["event_iou"].value == approx(4 / 5)
    assert scores["nothing moves"]["event_iou"].value == 0
    centre = scores["circle drawn at the slice's centre"]  # at 32.5: it reaches from 27.5 to 37.5 and holds no event
    assert centre["event_iou"].value == 0
    assert scores["model"] == scores["everything moves"]


def test_labels_of_events_are_a_row_of_their_own():
    events = joined([row_of_events([20, 25, 26], 0), row_of_events([44, 45], 24_000)])
    part, mask = Slice(40, FIRST_US, FIRST_US + 25_000, events), np.zeros((40, 60), bool)
    labels = np.array([True, True, False, True, False])
    scores = circle_scores(part, mask, MOVING, first_us=FIRST_US, labels=labels)
    assert scores["model, every event labelled"]["event_iou"].value == approx(3 / 4)
    assert scores["model"]["event_iou"].value == 0


def test_events_outside_the_time_of_the_truth_are_left_out():
    part = Slice(44, FIRST_US + 100_000, FIRST_US + 125_000, row_of_events([119, 120], 100_001))
    scores = circle_scores(part, np.ones((40, 130), bool), MOVING, first_us=FIRST_US)
    assert scores["everything moves"]["event_iou"].bottom == 0


def test_recall_and_false_alarms_are_shares_of_moving_and_of_other_events():
    scores = event_scores(np.array([True, True, False, False, False]), np.array([True, False, True, False, False]))
    assert (scores["recall"].value, scores["false_alarm_events"].value) == (0.5, approx(1 / 3))


def test_circles_are_read_with_their_remarks(tmp_path):
    (tmp_path / "c.csv").write_text("# a remark, with commas\nt_s,cx,cy,r\n0.0,1,2,3\n1.0,2,2,3\n")
    circles = load_circles(tmp_path / "c.csv")
    assert circles.distance(np.array([5.5]), np.array([2.0]), np.array([0.5])) == approx(1.0)


def test_bad_circles_are_refused(tmp_path):
    with pytest.raises(NotFound):
        load_circles(tmp_path / "c.csv")
    (tmp_path / "c.csv").write_text("t_s,cx,cy\n0.0,1,2\n")
    with pytest.raises(BadFile, match="'r'"):
        load_circles(tmp_path / "c.csv")


def test_known_scores_of_the_thrown_ball(shared_data):
    folder = shared_data("recordings/eed_what_is_background")
    circles = load_circles(folder / "ball_circle_gt.csv")
    recording = open_events(next(folder.glob("*.es")))
    everything = np.ones(recording.sensor, bool)
    parts = [circle_scores(each, everything, circles, first_us=recording.start_us) for each in in_slices(recording)]
    rows = {name: scores["event_iou"].value for name, scores in added_rows(parts).items()}
    densities = [rows[f"density {each:g}"] for each in baselines.THRESHOLDS]
    assert rows["everything moves"] == approx(0.04, abs=0.01)
    assert rows["circle drawn at the slice's centre"] == approx(0.72, abs=0.01)
    assert 0.4 < max(densities) < 0.55
