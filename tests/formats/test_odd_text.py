"""Text as programs and spreadsheets write it: other separators, units in headings, times in two columns, wraps."""

import tarfile
import zipfile

import numpy as np
import pytest

from evimo.errors import BadFile, EvimoWarning
from evimo.events.events import Events, joined
from evimo.formats import open_events
from evimo.formats.zstandard import zstd

SIZE = (48, 64)


@pytest.fixture
def events(some_events):
    found = some_events(12_000, span_us=3_000_000)
    return Events(found.x, found.y, found.t + 13, found.p)


def saved(path, events, form, head=""):
    rows = zip(events.t.tolist(), events.x, events.y, (events.p > 0).astype(int), strict=True)
    lines = [form.format(t=t, s=t / 1e6, sec=t // 10**6, ns=t % 10**6 * 1000, x=x, y=y, p=p) for t, x, y, p in rows]
    path.write_text(head + "\n".join(lines) + "\n", encoding="utf-8")
    return path


def with_comma(form):
    return lambda path, events: path.write_text(saved(path, events, form).read_text().replace(".", ","))


@pytest.mark.parametrize("form", ["{s:.6f};{x};{y};{p}", "{s:.6f}\t{x}\t{y}\t{p}", "{x};{y};{p};{s:.9f}"])
def test_decimal_commas_are_decimal_points(tmp_path, events, rows, form):
    with_comma(form)(tmp_path / "a.csv", events)
    assert rows(open_events(tmp_path / "a.csv", sensor=SIZE)) == rows([events])


def test_commas_that_may_stand_for_thousands_are_refused(tmp_path, events):
    saved(tmp_path / "a.txt", events, "{t:,} {x} {y} {p}")
    with pytest.raises(BadFile, match="or stand for thousands"):
        open_events(tmp_path / "a.txt", sensor=SIZE)
    with_comma("{s:.3f};{x};{y};{p}")(tmp_path / "b.txt", events)
    with pytest.raises(BadFile, match="or stand for thousands"):
        open_events(tmp_path / "b.txt", sensor=SIZE)


@pytest.mark.parametrize(
    "form", ["[{t}, {x}, {y}, {p}]", "({t}, {x}, {y}, {p})", "| {t} | {x} | {y} | {p} |", "{t}|{x}|{y}|{p}"]
)
def test_brackets_and_bars_are_spaces(tmp_path, events, rows, form):
    assert rows(open_events(saved(tmp_path / "a.txt", events, form), sensor=SIZE)) == rows([events])


@pytest.mark.parametrize(
    ("heading", "form", "unit"),
    [
        ("t_ns,x,y,p", "{t}000,{x},{y},{p}", "ns"),
        ("timestamp [us],x [px],y [px],polarity", "{t},{x},{y},{p}", "µs"),
        ("time(µs),x,y,p", "{t}.0,{x},{y},{p}", "µs"),
        ("time_s,x,y,on", "{s:.6f},{x},{y},{p}", "seconds"),
        ("time seconds,x,y,on", "{s:.6f},{x},{y},{p}", "seconds"),
    ],
)
def test_a_heading_tells_the_unit(tmp_path, events, rows, recwarn, heading, form, unit):
    recording = open_events(saved(tmp_path / "a.csv", events, form, heading + "\n"), sensor=SIZE)
    assert rows(recording) == rows([events])
    assert recording.format == f"text (times in {unit})" and not recwarn.list


def test_a_heading_that_cannot_be_is_not_believed(tmp_path, events, rows):
    path = saved(tmp_path / "a.csv", events, "{t},{x},{y},{p}", "t_s,x,y,p\n")  # 35 days of 48x64 pixels
    assert rows(open_events(path, sensor=SIZE)) == rows([events])


@pytest.mark.parametrize("heading", ["", "secs,nsecs,x,y,polarity\n"])
@pytest.mark.parametrize("since", ["", "16432436"])
def test_times_in_two_columns_are_refused_rather_than_read_by_halves(tmp_path, events, heading, since):
    path = saved(tmp_path / "a.csv", events, since + "{sec:02},{ns},{x},{y},{p}", heading)
    with pytest.raises(BadFile, match="times in two columns"):
        open_events(path, sensor=SIZE)


@pytest.mark.parametrize(
    "form", ["{t:#x} {x} {y} {p}", "10:33:{s:09.6f} {x} {y} {p}", "2024-01-01 10:33:{s:09.6f},{x},{y},{p}"]
)
def test_times_that_are_no_numbers_are_named(tmp_path, events, form, recwarn):
    with pytest.raises(BadFile, match=r"its times, such as .* are no numbers"):
        open_events(saved(tmp_path / "a.txt", events, form), sensor=SIZE)
    assert not recwarn.list


def test_few_lines_with_dates_are_no_heading(tmp_path, events):
    path = saved(tmp_path / "a.csv", events.part(0, 50), "2024-01-01 10:33:{s:09.6f},{x},{y},{p}", "t,x,y,p\n")
    with pytest.raises(BadFile, match=r"its times, such as '10:33:.* are no numbers"):
        open_events(path, sensor=SIZE)


def test_polarities_in_words_are_shown(tmp_path, events):
    path = saved(tmp_path / "a.csv", events, "{t},{x},{y},UP", "t,x,y,p\n")
    with pytest.raises(BadFile, match=r"such as .*,UP', are not `t x y p`"):
        open_events(path, sensor=SIZE)
    with pytest.raises(BadFile, match=r"in '\d+ \d+ \d+ UP' no order"):
        open_events(saved(tmp_path / "b.csv", events, "{t},{x},{y},UP"), sensor=SIZE)


@pytest.mark.parametrize(("on", "off"), [("ON", "OFF"), ("on", "off"), ("'1'", "'-1'")])
def test_polarities_in_words_and_quotes_are_read(tmp_path, events, rows, on, off):
    path = saved(tmp_path / "a.csv", events, "{t},'{x}',{y},{p}")
    path.write_text("".join(line[:-1] + (on if line[-1] == "1" else off) + "\n" for line in path.read_text().split()))
    assert rows(open_events(path, sensor=SIZE)) == rows([events])


@pytest.mark.parametrize(
    "heading",
    [
        *("t,y,x,p", "# t y x p", "% timestamp[us] y x polarity", "timestamp,y_coordinate,x_coordinate,polarity"),
        *(
            "t,v,u,p",
            "# Written by hand: timestamp(us) y x polarity",
            "ts,pos_y,pos_x,pol",
            "event_t,event_y,event_x,on",
        ),
    ],
)
def test_headings_of_all_kinds_name_the_order(tmp_path, events, rows, recwarn, heading):
    path = saved(tmp_path / "a.csv", events, "{t},{y},{x},{p}", heading + "\n")
    assert rows(open_events(path, sensor=SIZE)) == rows([events])
    assert not recwarn.list


def test_a_heading_of_unknown_names_is_said(tmp_path, events):
    path = saved(tmp_path / "a.csv", events, "{t},{y},{x},{p}", "zeit,zeile,spalte,vorzeichen\n")
    with pytest.warns(
        EvimoWarning, match="'zeit,zeile,spalte,vorzeichen' names no columns that are known: taken as txyp"
    ):
        open_events(path, sensor=SIZE)


@pytest.mark.parametrize(
    "line",
    [
        *("64 48", "64x48", "# 64 48", "# resolution: 64x48", "%geometry:64;48", "# width: 64, height: 48"),
        *("# width=64 height=48", "# sensor 64x48 of a desk", "# size: (64, 48)"),
    ],
)
def test_sizes_in_comments_are_heeded(tmp_path, events, line):
    assert open_events(saved(tmp_path / "a.csv", events, "{t},{x},{y},{p}", line + "\n")).sensor == SIZE


@pytest.mark.parametrize("line", ["# pixel size 15 x 15 um", "# window size: 50, 10"])
def test_other_sizes_in_comments_are_not_those_of_the_sensor(tmp_path, events, rows, line):
    path = saved(tmp_path / "a.csv", events, "{t},{x},{y},{p}", line + "\n")
    with pytest.warns(EvimoWarning, match="does not tell its sensor's size"):
        assert rows(open_events(path)) == rows([events])


@pytest.mark.parametrize("between", [":", "/"])
def test_lines_of_other_marks_are_shown(tmp_path, events, between):
    path = saved(tmp_path / "a.txt", events, between.join(("{t}", "{x}", "{y}", "{p}")))
    with pytest.raises(BadFile, match=r"holds no events: its lines, such as '\d+[:/].*\n  try: .*semicolons or bars"):
        open_events(path, sensor=SIZE)


@pytest.mark.parametrize("skipped", [b"\x50\x2a\x4d\x18", b"\x5f\x2a\x4d\x18"])
def test_frames_that_zstd_skips_are_skipped(tmp_path, events, rows, skipped):
    path = saved(tmp_path / "a.txt", events, "{t} {x} {y} {p}")
    whole = path.read_bytes()
    frame = skipped + (3).to_bytes(4, "little") + b"abc"
    path.with_suffix(".zst").write_bytes(frame + zstd().compress(whole[:5000]) + frame + zstd().compress(whole[5000:]))
    assert rows(open_events(path.with_suffix(".zst"), sensor=SIZE)) == rows([events])


@pytest.mark.parametrize("suffix", ["txt", "npz"])
@pytest.mark.parametrize("bits", [24, 31, 32])
def test_counters_that_start_over_go_on(tmp_path, events, rows, bits, suffix):
    """From the middle, too; and where events around the wrap are out of order."""
    t = events.t + (1 << bits) - 1_500_000
    stored = t % (1 << bits)
    near = np.flatnonzero(np.abs(t - (1 << bits)) < 20_000)
    order = np.arange(len(t))
    order[near] = near[::-1]
    table = np.stack((stored, events.x, events.y, events.p > 0), axis=1)[order]
    path = tmp_path / f"a.{suffix}"
    np.savetxt(path, table, fmt="%d") if suffix == "txt" else np.savez(path, events=table)
    recording = open_events(path, sensor=SIZE)
    assert len(near) > 10 and recording.start_us == t[0] and recording.stop_us == t[-1] + 1
    assert sorted(rows(recording)) == sorted(rows([Events(events.x, events.y, t, events.p)]))
    later = joined(list(recording.packets(start_us=(1 << bits) + 500_000)))
    assert later.t.tolist() == t[t >= (1 << bits) + 500_000].tolist()


def test_a_clock_that_starts_again_is_no_wrap(tmp_path, events):
    """At no number that fills its bits; the rest is shorter than what came before."""
    t = np.concatenate((events.t + 5_000_000, events.t[:3000]))
    rows = np.stack((t, *np.resize([1, 2, 1], (len(t), 3)).T), axis=1)
    np.savetxt(tmp_path / "a.txt", rows, fmt="%d")
    recording = open_events(tmp_path / "a.txt", sensor=SIZE)
    with pytest.warns(UserWarning, match="its clock starts again"):
        assert sum(map(len, recording)) == 12_000


@pytest.mark.parametrize("count", [8, 10, 40, 63, 64, 200])
def test_one_wrong_time_at_the_end_costs_one_event(tmp_path, count):
    lines = [f"{at * 3000} {at % 50} {at % 40} 1\n" for at in range(count)]
    (tmp_path / "a.txt").write_text("".join([*lines, "999999999999 3 4 1\n"]))
    recording = open_events(tmp_path / "a.txt", sensor=SIZE, time_unit="us")
    assert sum(map(len, recording)) == count and recording.stop_us == (count - 1) * 3000 + 1
    assert recording.faults.outlying == 1


def test_archives_of_several_files_are_called_that(tmp_path, events):
    saved(tmp_path / "events.txt", events, "{t} {x} {y} {p}")
    for suffix, how in (("tar", "w"), ("tar.gz", "w:gz")):
        with tarfile.open(tmp_path / f"a.{suffix}", how) as archive:
            archive.add(tmp_path / "events.txt", "events.txt")
        with pytest.raises(BadFile, match=rf"is a tar archive .*\n.*tar xf a\.{suffix}"):
            open_events(tmp_path / f"a.{suffix}")
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.write(tmp_path / "events.txt", "events.txt")
    with pytest.raises(BadFile, match=r"\(events.txt\)\n.*unpack it"):
        open_events(tmp_path / "a.zip")
