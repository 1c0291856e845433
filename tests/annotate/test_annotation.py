"""A capture of a simulated scene, mocap noise and all, annotated: against the simulator's exact truth, by rays."""

import numpy as np
import pytest

from evimo.annotate.annotation import Annotation, Instants, events_until, instants_of
from evimo.captures.capture import open_capture
from evimo.errors import BadFile, BadInput, NotFound
from evimo.events.events import Events, joined
from evimo.recordings.flow import true_flow
from evimo.recordings.recording import open_recording
from evimo.simulate.virtual_capture import MocapErrors, capture_virtually

OFFSET_US = -37_250


@pytest.fixture(scope="module")
def captured(filmed, tmp_path_factory):
    folder = tmp_path_factory.mktemp("virtual") / "desk"
    lost = (("Object_2", 0.03, 0.2),)
    planted, slices = capture_virtually(filmed, folder, MocapErrors(offset_us=OFFSET_US, lost=lost))
    return folder, planted, slices


@pytest.fixture(scope="module")
def annotated(captured, tmp_path_factory):
    out = tmp_path_factory.mktemp("out")
    annotation = Annotation(open_capture(captured[0]), Instants(40.0))
    assert annotation.missing(out) == [0]
    assert list(annotation.write(out, 0)) == [1, 2, 3, 4]
    assert annotation.missing(out) == []
    return annotation, out / "desk_000000"


def test_masks_and_depth_are_those_of_the_simulator(annotated, captured):
    recording = open_recording(annotated[1])
    assert recording.times_us.tolist() == [piece.truth.t_us for piece in captured[2]]
    for k, piece in enumerate(captured[2]):
        exact, made = piece.truth, recording.truth(k)
        for key in made.objects:
            one, other = exact.ids == key, made.ids == key
            assert one.sum() > 200
            assert (one & other).sum() / (one | other).sum() > 0.98
        both = exact.valid & made.valid & (exact.ids == made.ids)
        error = np.abs(made.depth[both] / exact.depth[both] - 1)
        assert np.median(error) < 0.001
        assert (error < 0.01).mean() > 0.99  # the others are at edges, half a pixel of mocap noise away


def test_motions_and_flow_are_those_of_the_simulator(annotated, captured, filmed):
    recording = open_recording(annotated[1])
    grid = np.moveaxis(filmed.camera.normalised(filmed.camera.pixels())[0], -1, 0)
    for k, piece in enumerate(captured[2]):
        exact, made = piece.truth, recording.truth(k)
        assert np.abs(made.ego[:3] - exact.ego[:3]).max() < 0.05  # m/s
        assert np.abs(made.ego[3:] - exact.ego[3:]).max() < 0.1  # rad/s
        same = exact.valid & made.valid & (exact.ids == made.ids)
        away = np.linalg.norm(true_flow(made, grid) - true_flow(exact, grid), axis=0)[same]
        assert np.median(away) < 0.1 * np.median(np.linalg.norm(true_flow(exact, grid), axis=0)[same])
        for key in made.objects.keys() & exact.objects.keys():
            assert np.abs(made.objects[key].rotation - exact.objects[key].rotation).max() < 0.3


def test_a_lost_object_voids_only_itself(annotated, captured):
    recording = open_recording(annotated[1])
    first, last = recording.truth(0), recording.truth(3)  # 12.5 ms, 87.5 ms; lost from 30 ms on
    assert sorted(first.objects) == [1, 2]
    assert first.valid.all()
    assert sorted(last.objects) == [1]
    assert not (last.ids == 2).any()
    void = ~last.valid
    near = captured[2][3].truth.ids == 2
    assert void.sum() > 200
    assert (void & near).sum() > 0.4 * near.sum()  # where it was seen last: it has moved since
    assert (last.ids == 1).sum() > 200


def test_all_events_are_kept_as_they_are(annotated, captured):
    recording = open_recording(annotated[1])
    made, exact = joined(list(recording.events)), joined([piece.events for piece in captured[2]])
    for name in ("x", "y", "t", "p"):
        np.testing.assert_array_equal(getattr(made, name), getattr(exact, name))


def test_both_layouts_hold_the_same_and_every_rate_is_possible(captured, tmp_path):
    capture = open_capture(captured[0])
    (tmp_path / "times.txt").write_text("30000\n61234 # here\n90000\n")
    truths = {}
    for layout in ("evimo2", "evimo1"):
        annotation = Annotation(capture, instants_of(str(tmp_path / "times.txt")), layout)
        list(annotation.write(tmp_path, 0))
        recording = open_recording(annotation.path(tmp_path, 0))
        assert recording.times_us.tolist() == [30_000, 61_234, 90_000]
        truths[layout] = recording.truth(1)
    np.testing.assert_array_equal(truths["evimo2"].depth, truths["evimo1"].depth)
    np.testing.assert_array_equal(truths["evimo2"].ids, truths["evimo1"].ids)
    fast = Annotation(capture, Instants(200.0)).times(0)
    assert np.diff(fast).tolist() == [5000] * 19
    assert set(range(12_500, 100_000, 25_000)) <= set(fast.tolist())  # the middles of slices


def test_a_clock_that_is_wrong_is_said_and_nothing_is_left_behind(captured, tmp_path):
    folder = captured[0]
    text = (folder / "calibration.yaml").read_text()
    (tmp_path / "capture.yaml").write_text(
        (folder / "capture.yaml").read_text().replace("recording: recording", f"recording: {folder / 'recording'}")
        .replace("scans/", f"{folder}/scans/").replace("- m", f"- {folder}/m")
    )  # fmt: skip
    (tmp_path / "calibration.yaml").write_text(text.replace(str(OFFSET_US), "99000000"))
    annotation = Annotation(open_capture(tmp_path), Instants())
    with pytest.raises(NotFound, match=r"no pose of the camera from 0 to .*\n.*offset_us"):
        list(annotation.write(tmp_path / "out", 0))
    assert not (tmp_path / "out").exists()
    (tmp_path / "calibration.yaml").write_text("{}")
    with pytest.raises(BadInput, match="evimo calibrate"):
        _ = Annotation(open_capture(tmp_path), Instants()).scene


@pytest.mark.parametrize(
    ("text", "kind", "words"),
    [("1\n2\nx\n", BadFile, "line 3"), ("5\n3\n", BadFile, "line 2: 3 is not after 5"), (None, NotFound, "no rate")],
)
def test_times_that_are_none_are_named(tmp_path, text, kind, words):
    if text:
        (tmp_path / "t.txt").write_text(text)
    with pytest.raises(kind, match=words):
        instants_of(str(tmp_path / "t.txt"))
    with pytest.raises(BadInput, match="rate"):
        instants_of("-3")


def test_times_outside_the_recording_and_no_threads_are_refused(captured):
    capture = open_capture(captured[0])
    with pytest.raises(BadInput, match="none of the times"):
        _ = Annotation(capture, Instants(listed_us=(10**9,))).frames
    with pytest.raises(BadInput, match="0 threads"):
        Annotation(capture, Instants(), threads=0)


def test_events_are_cut_whatever_their_packets():
    t = np.arange(20, dtype=np.int64)
    zero = np.zeros(20, np.uint16)
    events = Events(zero, zero, t, np.ones(20, np.int8))
    borders = np.array([5, 5, 12, 18])
    for size in (1, 3, 20):
        packets = [events.part(at, min(at + size, 20)) for at in range(0, 20, size)]
        assert [piece.t.tolist() for piece in events_until(packets, borders)] == [
            [0, 1, 2, 3, 4], [], [5, 6, 7, 8, 9, 10, 11], [12, 13, 14, 15, 16, 17]
        ]  # fmt: skip
