"""Text and CSV, against lines written with Python's own formatting."""

import csv
import gzip
import hashlib

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from evimo.errors import BadFile, BadInput, EvimoWarning
from evimo.events.events import joined
from evimo.formats import open_events, text_source
from evimo.formats.zstandard import zstd

SIZE = (48, 64)
QUIET = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def listed(events, form, *, on=1, off=0):
    return "".join(
        form.format(t=t, s=t / 1e6, x=x, y=y, p=on if p > 0 else off) + "\n"
        for x, y, t, p in zip(events.x, events.y, events.t, events.p, strict=True)
    )


def written(path, content):
    path.write_text(content, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "form",
    [
        "{t} {x} {y} {p}",
        "{s:.6f} {x} {y} {p}",
        "{s:.9f}\t{x}\t{y}\t{p}",
        "{s:.9f},{x},{y},{p}",
        " {t} ; {x} ; {y} ; {p} \r",
        "{s:.18e} {x:.18e} {y:.18e} {p:.18e}",
        "{t:.18e} {x:.18e} {y:.18e} {p:.18e}",
        "+{t} {x}.0 {y}.000 {p}",
    ],
)
def test_what_was_written_is_read(tmp_path, events, rows, form):
    opened = open_events(written(tmp_path / "a.txt", listed(events, form)), sensor=SIZE)
    assert (opened.sensor, opened.start_us, opened.stop_us) == (SIZE, events.t[0], events.t[-1] + 1)
    assert rows(opened) == rows([events])
    assert ("seconds" in opened.format) == ("{s" in form)


@pytest.mark.parametrize("signs", [(1, 0), (1, -1), ("+1", "-1")])
def test_polarity_is_zero_or_one_or_signed(tmp_path, events, rows, signs):
    content = listed(events, "{t} {x} {y} {p}", on=signs[0], off=signs[1])
    assert rows(open_events(written(tmp_path / "a.txt", content), sensor=SIZE)) == rows([events])


@QUIET
@given(
    st.lists(
        st.tuples(st.integers(0, 2 * 10**15), st.integers(0, 63), st.integers(0, 47), st.booleans()),
        min_size=1,
        max_size=7,
    ),
    st.sampled_from(["us", "s", "exponent"]),
)
def test_every_microsecond_survives(tmp_path, drawn, unit):
    """Of few events: after more, a single one that comes hours later is dropped as a wrong time."""
    drawn = sorted(drawn, key=lambda row: row[0])
    forms = {"us": "{0}", "s": "{1}.{2:06d}", "exponent": "{0}.0e-6"}
    path = written(
        tmp_path / "a.txt",
        "".join(
            forms[unit].format(t, t // 10**6, t % 10**6) + f" {x} {y} {int(on)}\n"
            for t, x, y, on in [*drawn, drawn[-1]]
        ),
    )
    (packet,) = open_events(path, sensor=SIZE, columns="txyp", time_unit="us" if unit == "us" else "s")
    assert packet.t.tolist()[:-1] == [t for t, *_ in drawn]
    assert packet.x.tolist()[:-1] == [x for _, x, *_ in drawn]
    assert packet.p.tolist()[:-1] == [2 * on - 1 for *_, on in drawn]


def test_blocks_of_any_size_give_the_same(tmp_path, events, rows, monkeypatch):
    path = written(tmp_path / "a.txt", listed(events, "{s:.6f} {x} {y} {p}"))
    for size in (64, 1000):
        monkeypatch.setattr(text_source, "BLOCK_BYTES", size)
        opened = open_events(path, sensor=SIZE)
        assert rows(opened) == rows([events])
        assert rows(opened.packets(70_000, 130_000)) == rows([events.between(70_000, 130_000)])


def test_a_fraction_anywhere_means_seconds_everywhere(tmp_path, monkeypatch):
    monkeypatch.setattr(text_source, "BLOCK_BYTES", 16)
    path = written(tmp_path / "a.txt", "0 1 1 1\n1 1 1 0\n2 1 1 1\n2.5 1 1 1\n")
    assert [t for packet in open_events(path, sensor=SIZE) for t in packet.t] == [0, 1_000_000, 2_000_000, 2_500_000]


def test_without_a_size_the_smallest_known_sensor_is_taken_and_said(tmp_path):
    path = written(tmp_path / "a.txt", "0 200 10 1\n5 3 4 0\n")
    with pytest.warns(EvimoWarning, match="taken as 240x180"):
        assert open_events(path).sensor == (180, 240)


def test_comments_headings_and_sizes_before_the_events_are_understood(tmp_path, events, rows):
    body = listed(events, "{t} {x} {y} {p}")
    for top in ("# made by hand\n\n", "t x y p\n", "64 48\n", "% a comment\nt,x,y,p\n"):
        opened = open_events(written(tmp_path / "a.txt", top + body), sensor=SIZE if "64" not in top else None)
        assert opened.sensor == SIZE and rows(opened) == rows([events])


def test_a_heading_names_the_order_of_columns(tmp_path, events, rows):
    content = "x,y,polarity,timestamp [us]\n" + listed(events, "{x},{y},{p},{t}")
    assert rows(open_events(written(tmp_path / "a.csv", content), sensor=SIZE)) == rows([events])


def test_lines_that_are_no_events_are_left_out_with_one_warning(tmp_path):
    path = written(
        tmp_path / "a.txt",
        "0 1 2 1\n1 1 2\n2 1.5 2 1\n3 1 2 7\n4 a 2 1\n\n# fine\n5 1 2 0\n6 1 2 0\n7 1 2 1\n8 1 2 0\n",
    )
    with pytest.warns(EvimoWarning, match=r"3 lines are no events .* first '1 1 2'; 1 events lie between pixels"):
        opened = open_events(path, sensor=SIZE)
    assert [t for packet in opened for t in packet.t] == [0, 2, 5, 6, 7, 8]


def test_a_file_cut_inside_a_line_is_used_with_a_warning(tmp_path, events, rows):
    path = written(tmp_path / "a.txt", listed(events, "{s:.6f} {x} {y} {p}")[:-3])
    with pytest.warns(EvimoWarning, match="1 lines are no events"):
        assert rows(open_events(path, sensor=SIZE)) == rows([events.part(0, len(events) - 1)])


def test_pixels_outside_are_dropped_and_counted(tmp_path):
    path = written(tmp_path / "a.txt", "0 64 0 1\n1 0 48 1\n2 -1 0 1\n3 70000 0 1\n4 63 47 1\n5 0 0 1\n")
    with pytest.warns(EvimoWarning, match="4 events outside the 64x48 sensor"):
        assert sum(map(len, open_events(path, sensor=SIZE))) == 2


def test_a_sensor_that_most_events_lie_outside_is_refused(tmp_path, some_events):
    path = written(tmp_path / "a.txt", listed(some_events(1000), "{t} {x} {y} {p}"))
    with pytest.raises(BadFile, match=r"\d+ of 1,000 events lie outside a sensor of 20x20\n  try: give its size"):
        list(open_events(path, sensor=(20, 20)))


def test_unsorted_lines_are_sorted_and_counted(tmp_path):
    path = written(tmp_path / "a.txt", "0 1 1 1\n7 1 1 1\n5 1 1 1\n9 1 1 1\n")
    with pytest.warns(EvimoWarning, match="1 events were out of order"):
        assert [t for packet in open_events(path, sensor=SIZE) for t in packet.t] == [0, 5, 7, 9]


@pytest.mark.parametrize(
    "content, words",
    [
        ("Dear diary,\ntoday nothing moved.\n", "it begins 'Dear diary,'"),
        ("0.1 12.5 20.25 8.5\n0.2 13.5 21.25 8.5\n", "no order of t, x, y and p makes sense"),
        ("# only a comment\n", "holds no events"),
        ("t,x,y,p\n", "holds no events"),
        ("1 2\n3 4\n", "holds no events"),
    ],
)
def test_what_is_no_recording_is_said(tmp_path, content, words):
    with pytest.raises(BadFile, match=words):
        open_events(written(tmp_path / "a.txt", content))


@pytest.mark.parametrize(
    "top, form, on, off",
    [
        ("%geometry:64,48\n", "{x},{y},{p},{t}", 1, 0),  # metavision_file_to_csv
        ("% geometry 64x48\n% x y p t\n", "{x},{y},{p},{t}", 1, 0),
        ("t,x@64,y@48,on\r\n", "{t},{x},{y},{p}\r", 1, 0),  # faery
        ("64 48\n", "{t} {x} {y} {p}", "True", "False"),
    ],
)
def test_exports_that_tell_their_size_are_read(tmp_path, events, rows, top, form, on, off):
    opened = open_events(written(tmp_path / "a.csv", top + listed(events, form, on=on, off=off)))
    assert opened.sensor == SIZE and rows(opened) == rows([events])


@pytest.mark.parametrize(
    "top, form, on, off",
    [
        (",t,x,y,p\n", "{i},{t},{x},{y},{p}", "True", "False"),  # pandas
        ("", "{i},{t},{x},{y},{p}", "true", "false"),
        ("timestamp,x,y,polarity,label\n", "{t},{x},{y},{p},car", 1, 0),
        ("# t x y p\n", "{t} {x} {y} {p}", 1, 0),  # numpy.savetxt with a header
        ('"x";"y";"t";"p"\n', '"{x}";"{y}";"{t}";"{p}"', 1, -1),
        ("", "{x} {y} {t} {p}", 1, 0),  # N-Cars
        ("", "{x}\t{y}\t{p}\t{t}", 1, 0),
        ("", "{x} {y} {s:.6f} {p}", 1, 0),
        ("", "{p};{t};{x};{y}", 1, 0),
        ("\ufeff", "{t},{x},{y},{p}", 1, 0),
        ("\ufefft,x,y,p\n", "{t},{x},{y},{p}", 1, 0),
    ],
)
def test_exports_are_read(tmp_path, events, rows, top, form, on, off):
    numbered = listed(events, form.replace("{i}", "@"), on=on, off=off).split("\n")
    body = "\n".join(line.replace("@", str(number)) for number, line in enumerate(numbered))
    assert rows(open_events(written(tmp_path / "a.csv", top + body), sensor=SIZE)) == rows([events])


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-8-sig", "latin-1"])
@pytest.mark.parametrize("packed", ["", ".gz", ".zst"])
@pytest.mark.parametrize("ends", ["\n", "\r\n", "\r"])
def test_wrappings_are_taken_off(tmp_path, events, rows, encoding, packed, ends, monkeypatch):
    monkeypatch.setattr(text_source, "BLOCK_BYTES", 1000)
    content = "# Größe\n" + listed(events, "{s:.6f},{x},{y},{p}")
    raw = content.replace("\n", ends).encode(encoding)
    pack = {"": bytes, ".gz": gzip.compress, ".zst": zstd().compress}[packed]
    path = tmp_path / f"a.csv{packed}"
    path.write_bytes(pack(raw))
    opened = open_events(path, sensor=SIZE)
    assert rows(opened) == rows([events])
    assert rows(opened.packets(70_000, 130_000)) == rows([events.between(70_000, 130_000)])


def test_a_compressed_text_cut_short_is_read_up_to_there(tmp_path):
    draw = np.random.default_rng(0)
    lines = "".join(f"{10 * t} {draw.integers(64)} {draw.integers(48)} {t & 1}\n" for t in range(20_000))
    for name, pack in (("a.txt.gz", gzip.compress), ("a.txt.zst", zstd().compress)):
        packed = pack(lines.encode())
        (tmp_path / name).write_bytes(packed[: len(packed) // 2])
        with pytest.warns(EvimoWarning, match="damaged or cut short"):
            count = sum(map(len, open_events(tmp_path / name, sensor=SIZE)))
        assert 2000 < count < 18_000, name


def test_pixels_between_pixels_are_rounded_and_said(tmp_path):
    path = written(tmp_path / "a.txt", "0 1.4 2.6 1\n10 63.2 46.5 0\n20 -0.4 0 1\n30 5.0 7.0 0\n")
    with pytest.warns(EvimoWarning, match="3 events lie between pixels and are rounded"):
        opened = open_events(path, sensor=SIZE)
    (packet,) = opened
    assert (packet.x.tolist(), packet.y.tolist()) == ([1, 63, 0, 5], [3, 47, 0, 7])


def test_said_columns_are_taken_as_said(tmp_path):
    path = written(tmp_path / "a.txt", "7 5 1 3 9\n8 6 0 4 9\n")
    (packet,) = open_events(path, sensor=SIZE, columns="tyPx_")
    assert (packet.t.tolist(), packet.x.tolist(), packet.y.tolist()) == ([7, 8], [3, 4], [5, 6])
    assert packet.p.tolist() == [1, -1]
    with pytest.raises(BadFile, match=r"has 5 columns .*, not the 4 of 'txyp'"):
        open_events(path, columns="txyp")
    with pytest.raises(BadInput, match="does not name t, x, y and p once each"):
        open_events(path, columns="txyy")


def test_columns_that_nothing_tells_apart_are_asked_for(tmp_path):
    lines = "".join(f"{k % 2} {k} {k % 2} {k}\n" for k in range(40))
    with pytest.raises(BadFile, match=r"its columns may be .* or .*, nothing tells\n  try: .*--columns"):
        open_events(written(tmp_path / "a.txt", lines))


def test_csv_has_the_digests_of_the_recording_it_was_made_from(tmp_path, shared_data):
    source = joined(list(open_events(shared_data("formats/event_stream/dvs.es"))))
    columns = np.stack([source.t, source.x, source.y, source.p > 0], axis=1)
    np.savetxt(tmp_path / "dvs.csv", columns, fmt="%d", delimiter=",", header="t,x,y,on", comments="")
    events = joined(list(open_events(tmp_path / "dvs.csv", sensor=(240, 320))))
    with shared_data("formats/expected_digests.csv").open() as table:
        expected = {row["field"]: row for row in csv.DictReader(table) if row["format"] == "csv"}
    stored = {"t": events.t.astype("<u8"), "x": events.x, "y": events.y, "on": events.p > 0}
    for field, column in stored.items():
        digest = hashlib.sha3_224(column.tobytes()).hexdigest()
        assert digest == expected[field]["sha3_224_of_the_column_bytes"], field


def test_circles_are_no_events(shared_data):
    with pytest.raises(BadFile):
        open_events(shared_data("recordings/eed_what_is_background/ball_circle_gt.csv"))


def test_real_text_and_the_recording_it_was_made_from_agree(shared_data):
    with pytest.warns(EvimoWarning, match="346x260"):
        (packet, *_) = open_events(shared_data("formats/text/ecd_text/events.txt"))
    (source, *_) = open_events(shared_data("formats/ros/davis346_1s_dvs_msgs.bag"))
    n = min(len(packet), len(source))
    assert (packet.t[:n] - packet.t[0]).tolist() == (source.t[:n] - source.t[0]).tolist()
    assert np.array_equal(packet.x[:n], source.x[:n]) and np.array_equal(packet.p[:n], source.p[:n])


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ("1 2 3\n" * 20, "its lines have 3 columns"),
        (" ".join(map(str, range(300))) + "\n", "its lines have 300 columns"),
    ],
)
def test_lines_of_too_few_or_too_many_columns_are_no_events(tmp_path, lines, words):
    """Found by fuzzing: three columns were a traceback, and all orders of three hundred were tried."""
    (tmp_path / "a.txt").write_text(lines)
    with pytest.raises(BadFile, match=words):
        open_events(tmp_path / "a.txt")


@pytest.mark.parametrize("pixel", ["inf", "nan", "1e400"])
def test_a_pixel_that_is_no_number_is_no_traceback(tmp_path, pixel):
    """Found by fuzzing: the sample from which the unit is guessed held it."""
    rows = [f"{1000 * k} {3 if k else pixel} 4 {k % 2}" for k in range(40)]
    (tmp_path / "a.txt").write_text("t x y p\n" + "\n".join(rows) + "\n")
    events = open_events(tmp_path / "a.txt", sensor=(48, 64))
    assert sum(map(len, events)) == 39


def test_a_time_beyond_all_exponents_costs_its_line(tmp_path):
    """Found by fuzzing: Python's decimals overflow."""
    rows = [f"{1000 * k} 3 4 {k % 2}" for k in range(40)] + ["1e999999999999999999 3 4 1"]
    (tmp_path / "a.txt").write_text("\n".join(rows) + "\n")
    assert sum(map(len, open_events(tmp_path / "a.txt", sensor=(48, 64)))) == 40
