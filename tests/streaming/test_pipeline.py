import threading
import time
import warnings
from dataclasses import replace
from itertools import islice, pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from evimo.errors import BadInput, EvimoWarning
from evimo.events.events import Events, joined
from evimo.formats.event_file import FoundCamera
from evimo.geometry.camera import Camera
from evimo.streaming import passes, pipeline
from evimo.streaming.inference import Network
from evimo.streaming.pipeline import Run, run


def maps_of(estimate):
    return estimate.moving_probability, estimate.ids, estimate.rel_depth, estimate.flow, estimate.ego


def assert_same(one, other):
    assert (one.t_us, one.start_us, one.stop_us) == (other.t_us, other.start_us, other.stop_us)
    for left, right in zip(maps_of(one), maps_of(other), strict=True):
        np.testing.assert_array_equal(left, right)
    assert [(x.id, x.box, x.area_px) for x in one.objects] == [(x.id, x.box, x.area_px) for x in other.objects]


@pytest.fixture
def whole(discs, recorded, fake_network, camera):
    return list(run(recorded(discs), model=fake_network, camera=camera))


def test_every_complete_slice_gives_one_estimate_on_the_grid_of_the_recording(whole, discs):
    first, last = int(discs.t[0]) // 25_000, (int(discs.t[-1]) + 1) // 25_000
    assert [estimate.start_us for estimate in whole] == [25_000 * k for k in range(first, last)]
    assert all(estimate.stop_us - estimate.start_us == 25_000 for estimate in whole)
    assert all(estimate.t_us == estimate.start_us + 12_500 for estimate in whole)


def test_two_discs_are_two_objects_all_along(whole):
    for estimate in whole[1:]:
        upper, lower = sorted(estimate.objects, key=lambda one: one.centroid[1])
        assert upper.rel_velocity[0] > 0 > lower.rel_velocity[0]  # the fake network says: ON moves right
        assert (upper.id, lower.id) == tuple(
            one.id for one in sorted(whole[1].objects, key=lambda one: one.centroid[1])
        )
    assert len({one.id for estimate in whole for one in estimate.objects}) == 2


def test_intrinsics_reach_the_network(whole, camera):
    np.testing.assert_allclose(whole[0].ego[:4], (camera.fx, camera.fy, camera.cx, camera.cy), rtol=1e-6)


def speeds(monkeypatch, events, model, camera, *, more):
    """What reaches the second pass of the first one's twist, when alignment adds `more` to it."""
    monkeypatch.setattr(passes, "aligned", lambda _, motion, **__: motion._replace(twist=motion.twist + more))
    return np.array([estimate.ego[4:] for estimate in run(events, model=model, camera=camera)])


def test_what_the_first_pass_says_reaches_the_second_aligned(monkeypatch, discs, recorded, fake_network, camera):
    one, other = (
        speeds(monkeypatch, recorded(discs), fake_network, camera, more=np.float32(more)) for more in (0, 0.5)
    )
    assert (one[:, 0] > 0.001).all()  # it says a speed that grows with the events it sees
    assert len(set(one[:, 0])) == len(one)
    assert (one[:, 1] == 1).all()
    np.testing.assert_allclose(other[:, 0], one[:, 0] + 0.5, rtol=1e-6)


@pytest.mark.parametrize("known", [True, False])
def test_a_rotation_that_a_gyroscope_measured_is_not_aligned(monkeypatch, discs, recorded, fake_network, camera, known):
    told = set()

    def aligned(_, motion, *, known_rotation):
        told.add(known_rotation)
        return motion

    monkeypatch.setattr(passes, "aligned", aligned)
    rotation = np.array((0, 0, 0, known), np.float32)
    monkeypatch.setattr(passes, "rotation_of", lambda *_: SimpleNamespace(of_slice=lambda *_: rotation))
    list(run(recorded(discs), model=fake_network, camera=camera))
    assert told == {known}


def test_masks_agree_with_those_of_both_neighbours(monkeypatch, discs, recorded, fake_network, camera):
    """A span inside a recording has both neighbours at its ends, too; the recording's ends have one."""
    rows = []

    def agreed(_, row):
        rows.append(row)
        return row[1]._replace(moving=np.full_like(row[1].moving, 0.25))

    monkeypatch.setattr(pipeline.Agreement, "of", agreed)
    events = recorded(discs)
    whole = list(run(events, model=fake_network, camera=camera))
    assert len(rows) == len(whole)
    assert rows[0][0] is None and rows[-1][2] is None
    assert all(each is not None for each in [*rows[0][1:], *(each for row in rows[1:-1] for each in row)])
    for row, following in pairwise(rows):
        assert following[0] is row[1] and following[1] is row[2]
    assert all(np.all(one.moving_probability == 0.25) for one in whole)
    rows.clear()
    part = list(run(events, model=fake_network, camera=camera, start_s=0.1, stop_s=0.3))
    assert len(rows) == len(part) < len(whole)
    assert all(each is not None for row in rows for each in row)


def test_a_path_events_and_an_array_are_run_alike(whole, discs, fake_network, camera, tmp_path):
    rows = np.stack((discs.t, discs.x, discs.y, discs.p > 0), axis=1)
    np.savetxt(tmp_path / "discs.txt", rows, fmt="%d")
    (tmp_path / "calib.txt").write_text(f"{camera.fx} {camera.fy} {camera.cx} {camera.cy} 0 0 0 0")
    given = [
        (discs, {"camera": camera}),
        (rows, {"sensor": camera.size, "camera": tmp_path / "calib.txt"}),
        (tmp_path / "discs.txt", {"sensor": camera.size, "camera": str(tmp_path / "calib.txt")}),
        (str(tmp_path / "discs.txt"), {"sensor": camera.size, "camera": camera}),
    ]
    for events, options in given:
        again = list(run(events, model=fake_network, **options))
        assert len(again) == len(whole)
        for one, other in zip(again, whole, strict=True):
            assert_same(one, other)


@pytest.mark.parametrize("every", [1, 7, 500, 4000])
def test_results_do_not_depend_on_packets(whole, discs, recorded, fake_network, camera, every):
    cuts = range(every, len(discs), every)
    again = list(run(recorded(discs, cuts=cuts), model=fake_network, camera=camera))
    assert len(again) == len(whole)
    for one, other in zip(again, whole, strict=True):
        assert_same(one, other)


@pytest.mark.parametrize(("start_s", "stop_s"), [(0.1, None), (0.137, 0.3), (0.0, 0.26), (0.26, 0.41)])
def test_a_span_gives_the_estimates_of_the_whole(whole, discs, recorded, fake_network, camera, start_s, stop_s):
    """Its grid does not move, and five neighbours to each side are read: rel_depth depends on events of two that are
    compensated by the first pass's answers for these two, which depend on two more; the mask on one more answer.
    """
    part = list(run(recorded(discs), model=fake_network, camera=camera, start_s=start_s, stop_s=stop_s))
    start_us = int(discs.t[0]) + round(start_s * 1e6)
    stop_us = int(discs.t[-1]) + 1 if stop_s is None else int(discs.t[0]) + round(stop_s * 1e6)
    expected = [one for one in whole if one.stop_us > start_us and one.stop_us <= stop_us]
    assert len(part) == len(expected) > 2
    for one, other in zip(part, expected, strict=True):
        assert one.start_us == other.start_us
        np.testing.assert_array_equal(one.rel_depth, other.rel_depth)
        np.testing.assert_array_equal(one.moving_probability, other.moving_probability)


def test_a_span_that_begins_in_silence_keeps_its_empty_slices(discs, recorded, fake_network, camera):
    quiet = (discs.t < discs.t[0] + 100_000) | (discs.t > discs.t[0] + 300_000)
    gappy = replace(discs, x=discs.x[quiet], y=discs.y[quiet], t=discs.t[quiet], p=discs.p[quiet])
    part = list(run(recorded(gappy), model=fake_network, camera=camera, start_s=0.15, stop_s=0.4))
    assert np.diff([one.start_us for one in part]).tolist() == [25_000] * (len(part) - 1)
    assert part[0].start_us == (int(discs.t[0]) + 150_000) // 25_000 * 25_000
    assert not part[0].objects


def test_the_camera_of_the_recording_is_used_else_a_guess_with_a_warning(discs, recorded, fake_network):
    events = recorded(discs)
    with pytest.warns(EvimoWarning, match="no calibration"):
        guessed = next(iter(run(events, model=fake_network)))
    assert guessed.ego[0] == pytest.approx(0.75 * 32)
    events.camera = FoundCamera(Camera(20.0, 21.0, 15.0, 12.0, 24, 32), "K")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        prepared = Run(events, Network(fake_network))
    assert prepared.camera_source == "the recording: K"
    assert next(prepared.slices())[0].ego[0] == pytest.approx(20)


def test_invalid_pixels_are_one_warning_and_their_events_are_counted(discs, recorded, fake_network):
    lens = Camera(12.0, 12.0, 15.5, 11.5, 24, 32, distortion=(-0.5, 0.1, 0.0, 0.0))
    with pytest.warns(EvimoWarning) as caught:
        prepared = Run(recorded(discs), Network(fake_network), camera=lens)
        estimates = [estimate for estimate, _ in prepared.slices()]
    assert len(caught) == 1
    assert not estimates[0].valid.all()
    assert prepared.placed.dropped > 0


def test_the_calibration_must_fit_the_sensor(discs, recorded, fake_network):
    with pytest.raises(BadInput, match="346x260 sensor, the recording of 32x24"):
        run(recorded(discs), model=fake_network, camera=Camera(200.0, 200.0, 170.0, 130.0, 260, 346))


def test_each_slice_comes_with_its_events(discs, recorded, fake_network, camera):
    for estimate, events in Run(recorded(discs), Network(fake_network), camera=camera).slices():
        expected = discs.between(estimate.start_us, estimate.stop_us)
        np.testing.assert_array_equal(events.t, expected.t)
        np.testing.assert_array_equal(events.x, expected.x)


@pytest.mark.parametrize("every", [7, 4000])
def test_labels_of_events_lie_beside_them_and_do_not_depend_on_packets(discs, recorded, fake_network, camera, every):
    cuts = range(every, len(discs), every)
    one, other = (
        list(run(recorded(discs, cuts=ends), model=fake_network, camera=camera, event_labels=True))
        for ends in ((), cuts)
    )
    for left, right in zip(one, other, strict=True):
        expected = discs.between(left.start_us, left.stop_us)
        np.testing.assert_array_equal(left.event_labels.events.t, expected.t)
        np.testing.assert_array_equal(left.event_labels.events.x, expected.x)
        assert {*np.unique(left.event_labels.objects)} <= {0, *(moving.id for moving in left.objects)}
        np.testing.assert_array_equal(left.event_labels.objects, right.event_labels.objects)
        np.testing.assert_array_equal(left.flow, right.flow)


def test_events_are_not_labelled_unasked(whole):
    assert all(estimate.event_labels is None for estimate in whole)


def test_time_is_kept_by_stage(discs, recorded, fake_network, camera):
    prepared = Run(recorded(discs), Network(fake_network), camera=camera)
    count = len(list(prepared.slices()))
    stages = (
        "reading slicing placing first_look local_motion first_pass alignment second_look second_pass agreement objects"
    )
    assert set(prepared.stopwatch.mean_ms(count)) == {stage.replace("_", " ") for stage in stages.split()}


def test_a_reader_that_fails_does_so_here_after_the_slices_before(discs, recorded, fake_network, camera):
    """A packet waits for the next one, in case that begins before its end."""
    events = recorded(discs, cuts=[3000, 4000, 5000])
    read = events.read

    def broken(start_us):
        yield from islice(read(start_us), 3)
        raise OSError("the cable was pulled")

    events.read = broken
    seen = []
    with pytest.raises(OSError, match="cable"):
        seen.extend(run(events, model=fake_network, camera=camera))
    assert seen


@pytest.mark.parametrize("event_labels", [False, True])
def test_stopping_early_ends_the_threads(discs, recorded, fake_network, camera, event_labels):
    before = threading.active_count()
    estimates = run(recorded(discs), model=fake_network, camera=camera, event_labels=event_labels)
    next(estimates)
    estimates.close()
    assert threading.active_count() == before


def test_estimates_may_be_kept(whole):
    """Buffers are reused inside; what is handed out is not."""
    assert not np.array_equal(whole[2].moving_probability, whole[-1].moving_probability)
    assert len({id(estimate.rel_depth) for estimate in whole}) == len(whole)


def without(events, first, last):
    """The events without those of slices first...last - 1, counted from the first whole one."""
    begin = (int(events.t[0]) // 25_000 + 1 + first) * 25_000
    at, till = np.searchsorted(events.t, (begin, begin + (last - first) * 25_000)).tolist()
    return joined([events.part(0, at), events.part(till, len(events))])


@pytest.mark.parametrize("event_labels", [False, True])
def test_nothing_is_known_of_slices_without_events_and_no_network_is_asked(
    discs, recorded, fake_network, camera, monkeypatch, event_labels
):
    asked = []
    usual = Network.first
    monkeypatch.setattr(Network, "first", lambda self, *given: asked.append(1) or usual(self, *given))
    made = Run(recorded(without(discs, 6, 9)), Network(fake_network), camera=camera, event_labels=event_labels)
    found = [estimate for estimate, _ in made.slices()]
    empty = [number for number, each in enumerate(found) if not each.has_events]
    assert empty == [7, 8, 9]
    assert made.finder.without_events == len(empty) == len(found) - len(asked)
    for number in empty:
        assert not found[number].valid.any() and not found[number].objects and not found[number].ids.any()
        assert np.isnan(found[number].ego).all()
        assert not event_labels or not len(found[number].event_labels.objects)
    assert all(np.isfinite(each.ego).all() and each.valid.any() for each in found if each.has_events)
    before, after = ({thing.id for thing in found[number].objects} for number in (6, 10))
    assert before and before == after  # 75 ms are within the memory of identities


def test_silence_costs_nearly_nothing(discs, recorded, fake_network, camera):
    """Twenty seconds of it, between half a second of events and one more event."""
    late = discs.part(0, 1)
    far = Events(late.x, late.y, late.t + 20_000_000, late.p)
    begun_s = time.process_time()
    estimates = list(run(recorded(joined([discs, far])), model=fake_network, camera=camera))
    assert sum(not each.has_events for each in estimates) > 700
    assert (time.process_time() - begun_s) / len(estimates) < 0.02
