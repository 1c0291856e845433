"""Recordings with planted defects: each is found, and a sound one has none."""

import numpy as np
import pytest
from tests.recordings.dataset_files import v1_meta, v1_npz, v1_text, v2_folder

from evimo.cli import main
from evimo.events.events import Events, joined
from evimo.formats import open_events
from evimo.geometry.camera import Camera
from evimo.recordings.alignment_check import alignment_of
from evimo.recordings.checking import findings
from evimo.recordings.recording import open_recording
from evimo.recordings.truth import ObjectTruth, Truth
from evimo.recordings.writer import RecordingWriter

SIZE = (120, 200)
CAMERA = Camera(200.0, 200.0, 99.5, 59.5, *SIZE)
SPEED = 300.0  # px/s, to the right


def mask(t_us):
    left = round(20 + SPEED * t_us * 1e-6)
    ids = np.zeros(SIZE, np.uint8)
    ids[40:80, left : left + 40] = 1
    return ids


def edge_events(t_us, rng):
    """What fires in one millisecond: the two edges that move, the texture between them, and noise."""
    left = 20 + SPEED * t_us * 1e-6 - 0.5  # a pixel reaches half a pixel to either side of its centre
    rows = rng.integers(40, 80, 30)
    x = np.concatenate((np.floor(0.5 + left + 40 * (rng.random(20) < 0.5)), rng.uniform(left, left + 40, 10)))
    y = np.concatenate((rows[:20], rows[20:]))
    noise = rng.integers(0, SIZE[1], 5), rng.integers(0, SIZE[0], 5)
    x, y = np.append(x, noise[0]), np.append(y, noise[1])
    return Events(x.astype(np.uint16), y.astype(np.uint16), np.full(35, t_us), rng.choice([-1, 1], 35).astype(np.int8))


def moving_box(folder, *, late_us=0, change=lambda events: events):
    rng = np.random.default_rng(0)
    whole = joined([edge_events(t, rng) for t in range(0, 350_000, 1000)])
    whole = change(Events(whole.x, whole.y, whole.t + late_us, whole.p))
    objects = {1: ObjectTruth(np.array((0, 0, 1.0)), np.array((1.5, 0, 0)), np.zeros(3))}
    with RecordingWriter(folder, CAMERA) as writer:
        for k in range(14):
            ids = mask(12_500 + 25_000 * k)
            stop = 25_000 * (k + 1) if k < 13 else 10**9
            depth = np.ones(SIZE, np.float32)
            seen = Truth(12_500 + 25_000 * k, depth, depth > 0, ids, ids > 5, np.zeros(6), objects)
            writer.write(whole.between(25_000 * k if k else 0, stop), seen)
    return folder


@pytest.mark.parametrize("late_ms", [0, 8, -6])
def test_how_late_events_are_is_measured_in_milliseconds(tmp_path, late_ms):
    keep = lambda events: Events(*(column[events.t >= 0] for column in (events.x, events.y, events.t, events.p)))  # noqa: E731
    folder = moving_box(tmp_path / "a", late_us=1000 * late_ms, change=keep)
    found = alignment_of(open_recording(folder))
    assert found.offset_ms == pytest.approx(late_ms, abs=0.7)
    assert found.frames > 10
    assert found.contrast > 1.3


def test_noise_tells_nothing(tmp_path):
    def scattered(events):
        rng = np.random.default_rng(1)
        x, y = rng.integers(0, SIZE[1], len(events)), rng.integers(0, SIZE[0], len(events))
        return Events(x.astype(np.uint16), y.astype(np.uint16), events.t, events.p)

    assert alignment_of(open_recording(moving_box(tmp_path / "a", change=scattered))).offset_ms is None


def defects(path, events=None):
    return {each.about: each.words for each in findings(path, open_events(events or path)) if each.defect}


def test_a_sound_recording_has_no_defect(tmp_path):
    assert defects(moving_box(tmp_path / "a")) == {}


def test_defects_of_events_are_found(tmp_path):
    def spoilt(events):
        kept = (events.t < 100_000) | (events.t >= 160_000)
        p = np.where(events.t > 180_000, 1, events.p).astype(np.int8)
        return Events(events.x[kept], events.y[kept], events.t[kept], p[kept])

    found = defects(moving_box(tmp_path / "a", late_us=5000, change=spoilt))
    assert found.keys() == {"event gaps", "polarity", "masks, events"}
    assert found["event gaps"] == "1, the longest 61.0 ms at 0.099 s"
    assert "correlation with time +0." in found["polarity"]
    assert found["masks, events"].startswith("events are 5.")


def test_defects_of_truth_are_found(tmp_path):
    meta = v1_meta()
    for k in (40, 41):
        meta["full_trajectory"][k]["cam"]["pos"]["t"]["x"] += 2
    for k in range(90, 110):
        meta["full_trajectory"][k]["2"]["pos"]["t"]["y"] = float("nan")
    found = defects(v1_npz(tmp_path / "a.npz", meta=meta))
    assert "2 of the camera" in found["bad poses"]
    assert found["object 2 lost"].startswith("1, the longest 105.0 ms at 0.445 s")
    assert "left out" in found["frames"]
    assert "frame gaps" in found


def test_a_principal_point_that_is_not_the_datasets_is_said(tmp_path):
    numbers = {"fx": 70.0, "fy": 72.0, "cx": 43.0, "cy": 25.5, "k1": -0.1, "k2": 0.02, "k3": 0.004, "k4": -0.003}
    straight = v1_npz(tmp_path / "a.npz", meta=v1_meta(numbers=numbers | {"res_x": 60, "res_y": 80}))
    assert "as written; points that land" in defects(straight)["principal point"]
    assert "principal point" not in defects(v1_npz(tmp_path / "b.npz"))
    assert "principal point" not in defects(v2_folder(tmp_path / "c"))


def test_the_command_lists_everything_and_goes_on_after_damage(tmp_path, capsys):
    folder = v1_text(tmp_path / "a")
    assert main(["check", str(folder)]) == 3  # events are strewn at random: not where the masks are
    said = capsys.readouterr().out
    assert "principal point" in said
    assert "  objects         1, 2 move; 3 rest throughout" in said
    (folder / "meta.txt").write_text("{}")
    assert main(["check", str(folder)]) == 3
    assert "! truth           " in capsys.readouterr().out
    assert main(["check", str(folder / "events.txt")]) == 0
    assert "none is stored with the events" in capsys.readouterr().out
