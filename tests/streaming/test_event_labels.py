from dataclasses import replace

import numpy as np
import pytest

from evimo.events.events import Events, joined, no_events
from evimo.geometry.camera import Camera
from evimo.geometry.rectification import rectified
from evimo.recordings.estimate import Estimate
from evimo.streaming.event_labels import EventLabeller
from evimo.streaming.objects import measured

SIZE, FOCAL_PX = (120, 160), 100.0
SLICE_US, START_US = 25_000, 5_000_000
STATIC = (-2.0, 0.0)  # px per slice, as every motion here
CENTRES = {1: (50, 40), 2: (110, 80)}
MOTIONS = {1: (3.0, 1.0), 2: (-1.0, -4.0)}
RADIUS = 14


@pytest.fixture(scope="module")
def rectification():
    return rectified(Camera(FOCAL_PX, FOCAL_PX, 79.5, 59.5, *SIZE))


@pytest.fixture(scope="module")
def labeller(rectification):
    return EventLabeller(rectification)


def discs(*, motions=MOTIONS, seed: int = 0):
    """Events of dots on two discs over a wall of dots, three slices about the one at START_US; and which is whose."""
    rng = np.random.default_rng(seed)
    parts = []
    for id_, motion in ({0: STATIC} | motions).items():
        spots = rng.uniform(-10, 170, (900, 2)) if id_ == 0 else disc_dots(rng, CENTRES[id_])
        which = rng.integers(0, len(spots), 60_000 if id_ == 0 else 3000)
        t = rng.uniform(-1.5, 1.5, len(which))
        parts.append(np.column_stack((spots[which] + t[:, None] * motion, t, np.full(len(t), id_))))
    x, y, t, ids = np.concatenate(parts).T
    hidden = np.zeros(len(t), np.bool_)
    for id_, motion in motions.items():  # the wall is not seen through the discs
        place = CENTRES[id_][0] + t * motion[0], CENTRES[id_][1] + t * motion[1]
        hidden |= (ids == 0) & (np.hypot(x - place[0], y - place[1]) < RADIUS + 1)
    inside = (np.rint(x) >= 0) & (np.rint(x) < SIZE[1]) & (np.rint(y) >= 0) & (np.rint(y) < SIZE[0])
    t_us = START_US + SLICE_US // 2 + np.floor(t * SLICE_US).astype(np.int64)
    order = np.argsort(t_us, kind="stable")
    order = order[(inside & ~hidden)[order]]
    polarity = np.where(rng.random(len(order)) < 0.5, 1, -1).astype(np.int8)
    xy = [np.rint(each[order]).astype(np.uint16) for each in (x, y)]
    return Events(*xy, t_us[order], polarity), ids[order].astype(np.uint8)


def disc_dots(rng, centre):
    angle, radius = rng.uniform(0, 2 * np.pi, 40), RADIUS * np.sqrt(rng.uniform(0, 1, 40))
    return np.column_stack((centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle)))


def estimate_of(*, off=(0.0, 0.0), wider_px: int = 0, motions=MOTIONS, ids=(1, 2)) -> Estimate:
    """What a network says that sees the discs too wide and their motion off by `off`; all is at depth 1."""
    rows, columns = np.mgrid[: SIZE[0], : SIZE[1]]
    image, flow = np.zeros(SIZE, np.uint8), np.empty((2, *SIZE), np.float32)
    per_s = 1e6 / SLICE_US / FOCAL_PX
    flow[:] = np.reshape(STATIC, (2, 1, 1)) * np.float32(per_s)
    for id_ in ids:
        inside = np.hypot(columns - CENTRES[id_][0], rows - CENTRES[id_][1]) <= RADIUS + wider_px
        image[inside] = id_
        flow[:, inside] = np.reshape(np.add(motions[id_], off), (2, 1)) * per_s
    velocities = np.zeros((256, 3))
    for id_ in ids:
        velocities[id_, :2] = (np.add(motions[id_], off) - STATIC) * per_s
    depth = np.ones(SIZE, np.float32)
    return Estimate(
        t_us=START_US + SLICE_US // 2,
        start_us=START_US,
        stop_us=START_US + SLICE_US,
        moving_probability=np.where(image > 0, np.float32(0.8), np.float32(0.05)),
        ids=image,
        rel_depth=depth,
        flow=flow,
        confidence=depth,
        valid=np.ones(SIZE, np.bool_),
        ego=np.array([-STATIC[0] * per_s, -STATIC[1] * per_s, 0, 0, 0, 0]),
        objects=measured(image, depth, velocities),
    )


def in_slice(events: Events, truth):
    first, last = np.searchsorted(events.t, (START_US, START_US + SLICE_US))
    return events.part(first, last), truth[first:last]


def event_iou(called, truth) -> float:
    return np.count_nonzero(called & truth) / np.count_nonzero(called | truth)


def test_two_discs_get_the_right_events(labeller):
    events, truth = discs()
    labels = labeller.label(estimate_of(), events).event_labels
    part, truth = in_slice(events, truth)
    np.testing.assert_array_equal(labels.events.t, part.t)
    for id_ in CENTRES:
        assert event_iou(labels.objects == id_, truth == id_) > 0.95


def test_sharpness_tells_events_in_masks_that_are_too_wide(labeller):
    events, truth = discs()
    estimate = estimate_of(wider_px=5)
    labels = labeller.label(estimate, events).event_labels
    part, truth = in_slice(events, truth)
    still = estimate.ids[part.y, part.x]
    assert event_iou(still > 0, truth > 0) < 0.8
    assert event_iou(labels.objects > 0, truth > 0) > event_iou(still > 0, truth > 0) + 0.05


@pytest.mark.parametrize("off", [(0.0, 0.0), (1.5, -1.0), (-1.0, 2.0)])
def test_flow_and_velocity_become_those_of_the_events(labeller, off):
    events, _ = discs()
    found = labeller.label(estimate_of(off=off), events)
    per_s = 1e6 / SLICE_US / FOCAL_PX
    for moving in found.objects:
        flow = found.flow[:, found.ids == moving.id].mean(axis=1) / per_s
        np.testing.assert_allclose(flow, MOTIONS[moving.id], atol=0.15)
        relative = np.subtract(MOTIONS[moving.id], STATIC) * per_s  # at depth 1
        np.testing.assert_allclose(moving.rel_velocity, (*relative, 0), atol=0.15 * per_s)


def test_what_the_network_takes_for_an_object_but_moves_as_the_world_keeps_its_motion(labeller):
    events, _ = discs(motions={})
    estimate = estimate_of(motions={1: STATIC, 2: STATIC})
    found = labeller.label(estimate, events)
    np.testing.assert_array_equal(found.flow, estimate.flow)
    for one, other in zip(found.objects, estimate.objects, strict=True):
        np.testing.assert_array_equal(one.rel_velocity, other.rel_velocity)


def test_without_objects_no_event_has_a_label(labeller):
    events, _ = discs(motions={})
    estimate = estimate_of(ids=())
    found = labeller.label(estimate, events)
    assert len(found.event_labels.objects) == len(found.event_labels.events) > 0
    assert not found.event_labels.objects.any()
    assert found.event_labels.objects.dtype == np.uint8


@pytest.mark.parametrize("window", ["nothing", "an empty slice", "one event"])
def test_few_events_are_no_difficulty(labeller, window):
    events, _ = discs()
    part, _ = in_slice(events, np.zeros(len(events)))
    before = events.between(0, START_US)
    few = {"nothing": no_events(), "an empty slice": before, "one event": joined([part.part(0, 1)])}[window]
    estimate = estimate_of()
    found = labeller.label(estimate, few)
    assert len(found.event_labels.objects) == (1 if window == "one event" else 0)
    assert np.isfinite(found.flow).all()


def test_an_object_at_the_border_and_events_without_a_place_are_no_difficulty():
    lens = rectified(Camera(60.0, 60.0, 79.5, 59.5, *SIZE, distortion=(-0.5, 0.1, 0.0, 0.0)))
    assert not lens.valid.all()
    events, _ = discs()
    ids = np.zeros(SIZE, np.uint8)
    ids[:20, 60:90] = 7
    ids[~lens.valid] = 0
    estimate = replace(estimate_of(), ids=ids, valid=lens.valid)
    estimate = replace(estimate, objects=measured(ids, estimate.rel_depth, np.zeros((256, 3))))
    labels = EventLabeller(lens).label(estimate, events).event_labels
    assert set(np.unique(labels.objects)) <= {0, 7}
    assert not labels.objects[~lens.valid[labels.events.y, labels.events.x]].any()


def test_the_same_again(labeller):
    events, _ = discs()
    one, other = (labeller.label(estimate_of(off=(1, 1)), events) for _ in range(2))
    np.testing.assert_array_equal(one.event_labels.objects, other.event_labels.objects)
    np.testing.assert_array_equal(one.flow, other.flow)


def test_the_estimate_itself_stays(labeller):
    events, _ = discs()
    estimate = estimate_of(off=(1, 1))
    before = estimate.flow.copy()
    labeller.label(estimate, events)
    np.testing.assert_array_equal(estimate.flow, before)
    assert estimate.event_labels is None
