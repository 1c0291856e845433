"""Tables of more than four columns, with headings that do not fit, marks for thousands, and pixels that are none."""

import numpy as np
import pytest

from evimo.errors import BadFile, EvimoWarning
from evimo.events.events import Events
from evimo.formats import open_events

SIZE = (48, 64)


@pytest.fixture
def events(some_events):
    found = some_events(12_000, span_us=3_000_000)
    return Events(found.x, found.y, found.t + 13, found.p)


def saved(path, events, form, head=""):
    rows = zip(events.t.tolist(), events.x, events.y, (events.p > 0).astype(int), strict=True)
    lines = [
        form.format(t=t, sec=t // 10**6, us=t % 10**6, ns=t % 10**6 * 1000, x=x, y=y, p=p, sign=2 * p - 1, n=number)
        for number, (t, x, y, p) in enumerate(rows)
    ]
    path.write_text(head + "\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("form", ["0 {t} {x} {y} {p}", "1 {x} {y} {t} {sign}", "{x} {y} 1 {t} {p}"])
def test_a_number_of_the_camera_is_no_polarity(tmp_path, events, rows, form):
    assert rows(open_events(saved(tmp_path / "a.txt", events, form), sensor=SIZE)) == rows([events])


@pytest.mark.parametrize("form", ["{t} {x} {y} 1 {p}", "{n} {t} {x} {y} 1 {p} {p}"])
def test_a_label_behind_events_of_one_polarity_is_none(tmp_path, events, rows, form):
    bright = Events(events.x, events.y, events.t, np.ones_like(events.p))
    assert rows(open_events(saved(tmp_path / "a.txt", events, form), sensor=SIZE)) == rows([bright])


def test_a_number_of_the_camera_in_an_array_is_no_polarity(tmp_path, events, rows):
    columns = np.stack([np.zeros(len(events)), events.t, events.x, events.y, events.p], axis=1)
    np.savez(tmp_path / "a.npz", events=columns.astype(np.int64))
    assert rows(open_events(tmp_path / "a.npz", sensor=SIZE)) == rows([events])


@pytest.mark.parametrize("form", ["{sec} {ns} {x} {y} {p}", "{x} {y} {sec} {ns} {p}"])
def test_seconds_of_a_recording_that_begins_at_zero_are_no_polarities(tmp_path, events, form):
    with pytest.raises(BadFile, match="its times in two columns"):
        open_events(saved(tmp_path / "a.txt", events, form), sensor=SIZE)


@pytest.mark.parametrize("heading", ["x,y,ts.secs,ts.nsecs,polarity", "x,y,t_sec,t_nanosec,p"])
def test_a_heading_tells_that_times_are_in_two_columns(tmp_path, events, heading):
    early = events.between(0, 900_000)  # of which the second stands still
    path = saved(tmp_path / "a.csv", early, "{x},{y},{sec},{ns},{p}", heading + "\n")
    with pytest.raises(BadFile, match=r"as its heading .* says"):
        open_events(path, sensor=SIZE)


def test_events_of_several_cameras_in_one_table_are_refused(tmp_path, events, rows):
    one = saved(tmp_path / "a.csv", events, "{t},{x},{y},{p},1", "t,x,y,p,camera_id\n")
    assert rows(open_events(one, sensor=SIZE)) == rows([events])
    two = saved(tmp_path / "b.csv", events, "{t},{x},{y},{p},{p}", "t,x,y,p,camera_id\n")
    with pytest.raises(BadFile, match="events of several cameras, told apart by its column 'camera_id'"):
        open_events(two, sensor=SIZE)
    assert len(rows(open_events(two, sensor=SIZE, columns="txyp_"))) == len(events)


@pytest.mark.parametrize("form", ['"{t:,}",{x},{y},{p}', '{x},{y},{p},"{t:,}"'])
def test_marks_for_thousands_in_quotes_are_called_that(tmp_path, events, form):
    with pytest.raises(BadFile, match="or stand for thousands"):
        open_events(saved(tmp_path / "a.csv", events, form, "t,x,y,p\n"), sensor=SIZE)


@pytest.mark.parametrize("form", ['"{s}";{x};{y};{p}', '"{s}";"{x}";"{y}";"{p}"', '"{x}"\t"{y}"\t"{s}"\t"{p}"'])
def test_decimal_commas_in_quotes_are_decimal_points(tmp_path, events, rows, form):
    short = Events(events.x, events.y, events.t // 4 + 5_000_000, events.p)  # within one second
    path = saved(tmp_path / "a.csv", short, form.replace("{s}", "{sec},{us:06d}"))
    assert rows(open_events(path, sensor=SIZE)) == rows([short])


@pytest.mark.parametrize(
    ("form", "words"),
    [
        ('"{sec},{us:06d}",{x},{y},{p}', "may be decimal points"),
        ('{x},{y},{p},"{sec},{us:06d}"', "may be decimal points"),
        ("{sec},{us:06d},{x},{y},{p}", "seconds and what is left of them"),
        ("{x},{y},{sec},{us:06d},{p}", "seconds and what is left of them"),
    ],
)
def test_decimal_commas_between_commas_are_refused(tmp_path, events, form, words):
    short = Events(events.x, events.y, events.t // 4 + 5_000_000, events.p)
    with pytest.raises(BadFile, match=words):
        open_events(saved(tmp_path / "a.csv", short, form), sensor=SIZE)


@pytest.mark.parametrize(
    ("form", "heading"),
    [
        ("{n} {t:09d} {x} {y} {p}", ""),
        ("{n} {t:09d} {x} {y} {p}", "id t x y p\n"),
        ("{p} {t:09d} {x} {y} {p}", "label t x y p\n"),
        ("{sec}.{us:06d} {x} {y} {p} 5", "t_sec x y p duration_usec\n"),
    ],
)
def test_what_stands_beside_times_is_not_always_the_rest_of_them(tmp_path, events, rows, form, heading):
    assert rows(open_events(saved(tmp_path / "a.txt", events, form, heading), sensor=SIZE)) == rows([events])


def test_whole_lines_in_quotes_are_read(tmp_path, events, rows):
    assert rows(open_events(saved(tmp_path / "a.csv", events, '"{t},{x},{y},{p}"'), sensor=SIZE)) == rows([events])


def test_a_heading_of_fewer_columns_than_the_lines_is_said(tmp_path, events, rows):
    with pytest.raises(BadFile, match="its heading names 4 columns, and its lines hold"):
        open_events(saved(tmp_path / "a.csv", events, "{t:,},{x},{y},{p}", "t,x,y,p\n"), sensor=SIZE)
    counted = saved(tmp_path / "b.csv", events, "{n} {x} {y} {p} {t}", "x y p t\n")
    assert rows(open_events(counted, sensor=SIZE)) == rows([events])
    more = saved(tmp_path / "c.csv", events, "{t} {x} {y} {p} 0.5", "t x y p\n")
    with pytest.warns(EvimoWarning, match="names 4 columns, and its lines hold 5: taken as txyp_"):
        assert rows(open_events(more, sensor=SIZE)) == rows([events])


def test_a_cell_that_is_missing_in_the_first_line_costs_that_line(tmp_path, events, rows):
    path = saved(tmp_path / "a.csv", events, "{t},{x},{y},{p}")
    path.write_text("5,,7,1\n" + path.read_text())
    with pytest.warns(EvimoWarning, match="1 lines are no events"):
        assert rows(open_events(path, sensor=SIZE)) == rows([events])


def test_a_minus_of_typesetters_is_a_minus(tmp_path, events, rows):
    path = saved(tmp_path / "a.csv", events, "{t},{x},{y},{sign}")
    path.write_text(path.read_text().replace("-", "\u2212"), encoding="utf-8")
    assert rows(open_events(path, sensor=SIZE)) == rows([events])


@pytest.mark.parametrize("wrong", ["-1", "70000"])
@pytest.mark.filterwarnings("ignore:a.csv does not tell")
def test_pixels_outside_every_sensor_say_nothing_of_its_size(tmp_path, events, rows, wrong):
    path = saved(tmp_path / "a.csv", events, "{t},{x},{y},{p}")
    path.write_text(path.read_text() + f"{events.t[-1] + 1},{wrong},5,1\n")
    opened = open_events(path)
    assert opened.sensor == (128, 128)
    with pytest.warns(EvimoWarning, match="1 events outside the 128x128 sensor were dropped"):
        assert rows(opened) == rows([events])


@pytest.mark.parametrize(
    "lines",
    [
        *("# height=48 width=64", "# width: 64\n# height: 48", "width,64\nheight,48\nt,x,y,p", "# Height 48, Width 64"),
        *(
            "# width 64 height 48 (pixels)",
            "# in pixels: width=64, height=48",
            "# 100 events a packet, width 64 height 48",
        ),
        *("# pixel size 18 um, width 64, height 48", "# width 64 height 48\n# pixel width 15 pixel_height 15"),
    ],
)
def test_sides_of_the_sensor_are_told_in_any_order_and_those_of_pixels_are_others(tmp_path, events, lines):
    assert open_events(saved(tmp_path / "a.csv", events, "{t},{x},{y},{p}", lines + "\n")).sensor == SIZE


@pytest.mark.parametrize("name", ["time_usec", "t[micros]", "timestamp_usecs"])
def test_more_names_of_units_are_known(tmp_path, events, rows, recwarn, name):
    path = saved(tmp_path / "a.csv", events, "{t},{x},{y},{p}", name + ",x,y,p\n")
    assert rows(open_events(path, sensor=SIZE)) == rows([events]) and not recwarn.list


@pytest.mark.filterwarnings("ignore:a.npz does not tell", "ignore:a.npz. times are taken as")
@pytest.mark.parametrize("padding", [np.nan, -1])
@pytest.mark.parametrize("kind", [1, 1e-6])
def test_rows_of_padding_say_nothing_of_the_unit(tmp_path, events, rows, padding, kind):
    columns = [events.t * kind, events.x, events.y, events.p > 0]
    np.savez(tmp_path / "a.npz", events=np.append(np.stack(columns, axis=1), np.full((500, 4), padding), axis=0))
    with pytest.warns(EvimoWarning, match="500 events"):
        assert rows(open_events(tmp_path / "a.npz")) == rows([events])


def test_sides_of_an_archive_that_are_swapped_are_turned_and_a_map_of_heights_is_no_side(tmp_path, events, rows):
    columns = {"t": events.t, "x": events.x, "y": events.y, "p": events.p > 0}
    np.savez(tmp_path / "a.npz", **columns, height=64, width=48)
    with pytest.warns(EvimoWarning, match="fit only one of 64x48: its sides are swapped"):
        assert rows(open_events(tmp_path / "a.npz")) == rows([events])
    np.savez(tmp_path / "b.npz", **columns, height=np.zeros(SIZE), width=3)
    assert open_events(tmp_path / "b.npz").sensor == (128, 128)


def test_sides_in_a_heading_that_are_swapped_are_turned_but_not_those_of_swapped_columns(tmp_path, events, rows):
    path = saved(tmp_path / "a.txt", events, "{t} {x} {y} {p}", "48 64\n")
    with pytest.warns(EvimoWarning, match="fit only one of 64x48: its sides are swapped"):
        assert rows(open_events(path)) == rows([events])
    path = saved(tmp_path / "b.txt", events, "{t} {y} {x} {p}", "64 48\n")
    with pytest.warns(EvimoWarning, match="events outside the 64x48 sensor were dropped"):
        assert len(rows(open_events(path))) < len(events)
