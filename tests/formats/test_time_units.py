"""Units of time: found from real recordings written in each unit, said when guessed, refused when impossible."""

import h5py
import numpy as np
import pytest

from evimo.errors import BadFile, EvimoWarning
from evimo.events.events import joined
from evimo.formats import open_events
from evimo.formats.time_units import as_us, repeat_of

REAL = {
    "recordings/davis346_road/davis346.aedat4": 40_000,
    "recordings/eed_what_is_background/EED_what_is_background_events.es": 40_000,
    "recordings/davis240_boxes_imu/IMU_translBoxes.aedat": 40_000,
    "recordings/davis346_night/events.npz": 40_000,
    "formats/ros/event_camera_msgs_evt3.bag": 40_000,
}
# How the time of an event is written, from µs after some start: by C, pandas, NumPy, ROS and Metavision.
FORMS = {
    "us": "{0}",
    "us as float": "{0}.0",
    "us by %f": "{0}.000000",
    "ns": "{0}000",
    "s": "{1}.{2:06d}",
    "s to the ns": "{1}.{2:06d}000",
    "ms": "{3}.{4:03d}",
}
STARTS_US = {"zero": 0, "uptime": 57_922_807_588, "unix": 1_643_243_628_737_093}


def text_of(events, form, start_us):
    lines = []
    for x, y, t, p in zip(events.x, events.y, (events.t - events.t[0] + start_us).tolist(), events.p, strict=True):
        written = form.format(t, t // 10**6, t % 10**6, t // 1000, t % 1000)
        lines.append(f"{written} {x} {y} {int(p > 0)}\n")
    return "".join(lines)


@pytest.mark.filterwarnings("ignore::evimo.errors.EvimoWarning")
@pytest.mark.parametrize("name", REAL)
def test_the_unit_of_real_recordings_is_found_in_every_form(tmp_path, name, shared_data):
    recording = open_events(shared_data(name))
    events = joined(list(recording)).part(0, REAL[name])
    for form in FORMS:
        for start, start_us in STARTS_US.items():
            path = tmp_path / "a.txt"
            path.write_text(text_of(events, FORMS[form], start_us))
            opened = open_events(path, sensor=recording.sensor)
            found = (opened.start_us, opened.stop_us)
            assert found == (start_us, start_us + events.t[-1] - events.t[0] + 1), (form, start)


def table(events, scale, kind, start_us=0):
    t = (events.t - events.t[0] + start_us) * scale
    return np.stack([np.asarray(each, np.float64) for each in (t, events.x, events.y, events.p > 0)], 1).astype(kind)


@pytest.mark.parametrize("scale, kind", [(1e-6, "f8"), (1, "f8"), (1000, "f8"), (1000, "i8"), (1e-6, "f4"), (1, "u4")])
@pytest.mark.filterwarnings("ignore::evimo.errors.EvimoWarning")
def test_npz_and_evimo2_are_judged_alike(tmp_path, some_events, scale, kind):
    events = some_events(20_000, span_us=4_000_000)
    stored = table(events, scale, kind)
    np.savez(tmp_path / "a.npz", events=stored)
    np.save(tmp_path / "dataset_events_t.npy", stored[:, 0])
    np.save(tmp_path / "dataset_events_xy.npy", stored[:, 1:3].astype(np.uint16))
    np.save(tmp_path / "dataset_events_p.npy", stored[:, 3].astype(np.uint8))
    for path in (tmp_path / "a.npz", tmp_path):
        opened = open_events(path, sensor=(48, 64))
        span = events.t[-1] - events.t[0]
        assert abs(opened.stop_us - opened.start_us - 1 - span) <= (1 if kind != "f4" else 2), path


def test_a_guess_against_the_usual_unit_is_said(tmp_path, some_events):
    (tmp_path / "a.txt").write_text(text_of(some_events(5000, span_us=900_000), FORMS["ns"], 0))
    with pytest.warns(EvimoWarning, match=r"times are taken as ns \(in ns .* in µs .*; --time-unit sets their unit"):
        opened = open_events(tmp_path / "a.txt", sensor=(48, 64))
    assert opened.format == "text (times in ns, guessed)"


@pytest.mark.parametrize("unit, times", [("s", 10**6), ("ms", 1000), ("us", 1), ("ns", 0.001)])
def test_a_unit_that_is_said_is_taken_as_it_is(tmp_path, unit, times):
    (tmp_path / "a.txt").write_text("1000 1 2 1\n5000 3 4 0\n")
    opened = open_events(tmp_path / "a.txt", sensor=(48, 64), time_unit=unit)
    assert (opened.start_us, opened.stop_us - 1) == (1000 * times, 5000 * times)
    assert "guessed" not in opened.format


def test_times_of_no_camera_name_the_option(tmp_path):
    lines = "".join(f"{t * 10**12} {t % 60} {t % 40} 1\n" for t in range(1000))
    (tmp_path / "a.txt").write_text(lines)
    with pytest.raises(BadFile, match="no camera does that\n  try: give the unit of its times with --time-unit"):
        open_events(tmp_path / "a.txt")


def test_times_far_below_zero_are_kept(tmp_path, some_events, rows):
    events = some_events(3000)
    lines = "".join(f"{t - 150_000} {x} {y} {p}\n" for x, y, t, p in rows([events]))
    (tmp_path / "a.txt").write_text(lines)
    opened = open_events(tmp_path / "a.txt", sensor=(48, 64))
    assert (opened.start_us, opened.stop_us) == (events.t[0] - 150_000, events.t[-1] - 150_000 + 1)


@pytest.mark.parametrize("wrong", ["nan", "inf", "-nan", "1e30", "99999999999999999999999"])
def test_a_time_that_is_no_number_costs_one_event(tmp_path, some_events, rows, wrong):
    events = some_events(3000)
    lines = [f"{t} {x} {y} {p}\n" for x, y, t, p in rows([events])]
    lines[1500] = f"{wrong} 1 2 1\n"
    (tmp_path / "a.txt").write_text("".join(lines))
    with pytest.warns(EvimoWarning, match=r"1 (lines|events)"):
        assert rows(open_events(tmp_path / "a.txt", sensor=(48, 64))) == rows(
            [events.part(0, 1500), events.part(1501, 3000)]
        )


@pytest.mark.parametrize(
    "suffix, jump_us",
    [
        *((suffix, 3_600_000_000) for suffix in ("txt", "npz", "h5")),
        *((suffix, -(1 << bits)) for suffix in ("txt", "npz") for bits in (24, 31, 32)),
    ],
)
def test_a_pause_or_a_wrap_among_few_events_leaves_the_unit(tmp_path, suffix, jump_us):
    """Most pixels see one event before it and one after it, which says nothing of how soon they see the next."""
    draw = np.random.default_rng(0)
    t, x, y = np.sort(draw.integers(0, 200_000, 12_000)), draw.integers(0, 200, 12_000), draw.integers(0, 150, 12_000)
    start_us = max(-jump_us - 100_000, 0)
    stored = t + start_us + np.where(t < 100_000, 0, jump_us)
    save(tmp_path / f"a.{suffix}", stored, x, y)
    opened = open_events(tmp_path / f"a.{suffix}", sensor=(180, 240))
    assert (opened.start_us, opened.stop_us) == (start_us + t[0], start_us + t[-1] + 1 + max(jump_us, 0))


def save(path, t, x, y):
    columns = {"t": t, "x": x, "y": y, "p": np.arange(len(t)) % 2}
    if path.suffix == ".txt":
        np.savetxt(path, np.stack(list(columns.values()), axis=1), fmt="%d")
    elif path.suffix == ".npz":
        np.savez(path, **columns)
    else:
        with h5py.File(path, "w") as file:
            for name, column in columns.items():
                file[f"events/{name}"] = column


@pytest.mark.parametrize("kind", ["f4", "<i8"])
@pytest.mark.parametrize("suffix", ["txt", "npz", "h5", ""])
def test_times_that_stand_still_are_refused(tmp_path, some_events, suffix, kind):
    """Seconds since 1970 in float32, or with six digits, are all the same."""
    events = some_events(5000)
    t = (events.t * 1e-6 + 1_589_163_147).astype(np.float32) if kind == "f4" else np.zeros(5000, np.int64)
    path = tmp_path / (f"a.{suffix}" if suffix else "folder")
    if suffix:
        save(path, t, events.x, events.y)
    else:
        path.mkdir()
        for name, array in (("t", t), ("xy", np.stack((events.x, events.y), axis=1)), ("p", events.p > 0)):
            np.save(path / f"dataset_events_{name}.npy", array)
    with pytest.raises(BadFile, match="its 5,000 events lie within 1 µs: their times stand still"):
        open_events(path, sensor=(48, 64))


@pytest.mark.parametrize("kind", ["u1", "u2", "f2"])
@pytest.mark.parametrize("suffix", ["npz", "h5"])
def test_times_in_small_types_are_no_traceback(tmp_path, some_events, recwarn, suffix, kind):
    events = some_events(200)
    t = (events.t // 1000).astype(kind)
    save(tmp_path / f"a.{suffix}", t, events.x.astype("f2"), events.y.astype("f2"))
    opened = open_events(tmp_path / f"a.{suffix}", sensor=(48, 64), time_unit="ms")
    assert opened.stop_us == int(t[-1]) * 1000 + 1 and sum(map(len, opened)) == 200
    assert not recwarn.list


def test_a_unit_that_is_said_and_cannot_be_is_said_to_be_so(tmp_path, some_events):
    (tmp_path / "a.txt").write_text(text_of(some_events(20_000), "{0}", 0))
    with pytest.warns(EvimoWarning, match=r"in ns there would be .*: no camera does that; --time-unit ns may not"):
        open_events(tmp_path / "a.txt", sensor=(48, 64), time_unit="ns")


def test_times_none_of_which_is_a_number(tmp_path, some_events, recwarn):
    events = some_events(500)
    np.savez(tmp_path / "a.npz", t=np.full(500, np.nan), x=events.x, y=events.y, p=events.p)
    with pytest.raises(BadFile, match="none of its times is a number"):
        open_events(tmp_path / "a.npz", sensor=(48, 64))
    (tmp_path / "a.csv").write_text("t_us,x,y,p\n" + "nan,1,2,1\nnan,3,4,0\n" * 50)
    with pytest.raises(BadFile, match="none of its times is a number"):
        open_events(tmp_path / "a.csv", sensor=(48, 64))
    assert not recwarn.list


def test_times_of_few_frames_tell_how_soon_a_pixel_sees_the_next_event():
    t = np.repeat(np.arange(4) * 20_000, 5000)
    x, y = (np.random.default_rng(0).integers(0, side, len(t)) for side in (120, 100))
    assert repeat_of(x, y, t) == 20_000


@pytest.mark.parametrize("kind", ["u4", "i4", "i8", "u8", "f8"])
def test_times_become_whole_microseconds(kind):
    stored = np.array([0, 1499, 1500, 2_000_000_000]).astype(kind)
    assert as_us(stored, "ns").tolist() == [0, 1, 2, 2_000_000]
    assert as_us(stored, "us").tolist() == [0, 1499, 1500, 2_000_000_000]
    assert as_us(stored, "s").tolist() == [0, 1_499_000_000, 1_500_000_000, 2_000_000_000_000_000]
