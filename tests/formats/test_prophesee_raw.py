"""Prophesee RAW: headers old, new and absent, both byte orders of EVT 2.1, blocks, seeking, damage, what we write."""

import re
import warnings

import numpy as np
import pytest

from evimo.errors import BadFile, EvimoWarning
from evimo.events.events import Events, joined
from evimo.formats import open_events, word_file
from evimo.formats.saving import save_events

OLD = "% Date 2020-09-25 07:48:31\n% evt {evt}\n% plugin_name hal_plugin_{plugin}\n% system_ID 21\n"
NEW = "% date 2023-10-19 03:51:23\n% evt {evt}\n% format {format};height=48;width=64\n% geometry 64x48\n% end\n"
NAMES = {"evt2": ("2.0", "EVT2"), "evt21": ("2.1", "EVT21"), "evt3": ("3.0", "EVT3")}


@pytest.fixture(params=NAMES)
def kind(request):
    return request.param


def written(path, body, head=""):
    path.write_bytes(head.encode() + (body if isinstance(body, bytes) else body.tobytes()))
    return path


def new_header(kind):
    evt, name = NAMES[kind]
    return NEW.format(evt=evt, format=name)


def raw_file(path, encoded, kind, events):
    return written(path, getattr(encoded, kind)(events)[0], new_header(kind))


@pytest.mark.parametrize("block", [3, 100, 4096, 1 << 19])
def test_what_was_written_is_read(tmp_path, kind, encoded, events, rows, monkeypatch, block):
    monkeypatch.setattr(word_file, "BLOCK_BYTES", block)
    opened = open_events(raw_file(tmp_path / "a.raw", encoded, kind, events))
    assert (opened.sensor, opened.start_us, opened.stop_us) == ((48, 64), events.t[0], events.t[-1] + 1)
    assert rows(opened) == rows([events])
    for window in ((70_000, 130_000), (0, 1), (199_000, 10**9)):
        assert rows(opened.packets(*window)) == rows([events.between(*window)])
    assert opened.faults.dropped == 0


def test_bytes_of_something_else_before_the_first_word_hardly_ever_shift_times(tmp_path, kind, encoded, events):
    words, right = getattr(encoded, kind)(events)[0].tobytes(), 0
    for seed in range(40):
        draw = np.random.default_rng(seed)
        path = written(tmp_path / f"{seed}.raw", draw.bytes(8 * draw.integers(1, 100)) + words, new_header(kind))
        right += np.isin(joined(list(open_events(path))).t, events.t).sum() > 0.98 * len(events)
    assert right >= 38  # of so short damage every other used to count a round too many


def test_few_events_do_not_keep_room_for_as_many_as_there_are_words(tmp_path, kind, encoded, some_events, rows):
    events = some_events(20, span_us=2_000)
    words, _ = getattr(encoded, kind)(events)
    triggers = np.full(10_000, 10 << 8 * words.itemsize - 4, words.dtype)
    opened = open_events(written(tmp_path / "a.raw", np.concatenate([words, triggers]), new_header(kind)))
    packets = list(opened.read(0))
    assert rows(packets) == rows([events])
    assert all(column.base is None for packet in packets for column in (packet.x, packet.y, packet.t, packet.p))


def test_seeking_does_not_begin_at_the_beginning(tmp_path, kind, encoded, some_events, monkeypatch):
    monkeypatch.setattr(word_file, "BLOCK_BYTES", 4096)
    events = some_events(5000)
    opened = open_events(raw_file(tmp_path / "a.raw", encoded, kind, events))
    first = next(packet for packet in opened.read(150_000) if len(packet))
    assert 50_000 < first.t[0] <= 150_000


@pytest.mark.parametrize(
    "evt, plugin, size",
    [("2.0", "gen3_fx3", (480, 640)), ("3.0", "gen41_evk3", (720, 1280)), ("3.0", "imx636_evk4", (720, 1280))],
)
def test_old_headers_tell_the_sensor_by_the_name_of_the_camera(tmp_path, encoded, events, evt, plugin, size):
    words = {"2.0": encoded.evt2, "3.0": encoded.evt3}[evt](events)[0]
    opened = open_events(written(tmp_path / "a.raw", words, OLD.format(evt=evt, plugin=plugin)))
    assert opened.sensor == size and sum(map(len, opened)) == len(events)


@pytest.mark.parametrize(
    "head",
    [
        "% evt {evt}\r\n% geometry 64x48\r\n",
        "% format {format};width=64;height=48\n% end\n",
        "% format {format}\n% geometry 64x48\n% integrator_name Prophesee\n% end\n",
        "%evt {evt}\n%geometry 64x48\n%end\n",
        "% EVT {evt}\n% geometry 64x48\n% end\n",
        "% format EVT{evt};height=48;width=64\n% end\n",
        "% format evt{evt};height=48;width=64\n% end\n",
    ],
)
def test_headers_of_the_wild(tmp_path, kind, encoded, events, rows, head):
    evt, name = NAMES[kind]
    words = getattr(encoded, kind)(events)[0]
    opened = open_events(written(tmp_path / "a.raw", words, head.format(evt=evt, format=name)))
    assert opened.sensor == (48, 64) and rows(opened) == rows([events])


def test_without_a_header_the_words_tell_their_encoding(tmp_path, kind, encoded, some_events, rows):
    events = some_events(3000)
    with pytest.warns(EvimoWarning, match="taken as 128x128"):
        opened = open_events(written(tmp_path / "a.raw", getattr(encoded, kind)(events)[0]))
    assert NAMES[kind][0] in opened.format and rows(opened) == rows([events])


def test_a_header_without_encoding_leaves_it_to_the_words(tmp_path, kind, encoded, some_events, rows):
    events = some_events(3000)
    head = "% Date 2020-09-25\n% integrator_name Prophesee\n% geometry 64x48\n"
    opened = open_events(written(tmp_path / "a.raw", getattr(encoded, kind)(events)[0], head))
    assert NAMES[kind][0] in opened.format and rows(opened) == rows([events])


@pytest.mark.parametrize("told", ["", "% endianness legacy\n", "% endianness little\n"])
def test_both_orders_of_evt21_are_read_whatever_the_header_says(tmp_path, encoded, events, rows, told):
    words, _ = encoded.evt21(events)
    head = f"% evt 2.1\n{told}% geometry 64x48\n% end\n"
    swapped = words.view("<u4").reshape(-1, 2)[:, ::-1].copy()
    for name, body in (("little", words), ("legacy", swapped)):
        assert rows(open_events(written(tmp_path / f"{name}.raw", body, head))) == rows([events])


def test_a_vector_word_of_evt21_holds_32_pixels(tmp_path):
    high, head = 8 << 28, 1 << 28 | 5 << 22 | 32 << 11 | 7
    words = np.array([high << 32, head << 32 | 0x8000_0001, (high | 1) << 32, head << 32 | 0xFFFF_FFFF], "<u8")
    events = joined(list(open_events(written(tmp_path / "a.raw", words, "% evt 2.1\n% geometry 64x48\n% end\n"))))
    assert events.x.tolist() == [32, 63, *range(32, 64)]
    assert set(events.y.tolist()) == {7} and events.t.tolist() == [5] * 2 + [69] * 32


@pytest.mark.parametrize("bytes_left", [1, 3])
def test_a_file_cut_inside_a_word_is_read_with_a_warning(tmp_path, kind, encoded, events, rows, bytes_left):
    words, _ = getattr(encoded, kind)(events)
    size = words.itemsize
    left = min(bytes_left, size - 1)
    path = written(tmp_path / "a.raw", words.tobytes()[: -size + left], new_header(kind))
    with pytest.warns(EvimoWarning, match=f"its last {left} bytes"):
        opened = open_events(path)
    assert rows(opened)[:990] == rows([events])[:990]


@pytest.mark.parametrize("body", [b"", b"\x00", bytes(4)])
def test_a_file_without_events_says_so(tmp_path, kind, body):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", EvimoWarning)
        with pytest.raises(BadFile, match="holds no events"):
            open_events(written(tmp_path / "a.raw", body, new_header(kind)))


@pytest.mark.parametrize("name", ["EVT4", "HISTO3D", "DIFF3D", "AER-8B"])
def test_other_encodings_are_named(tmp_path, name):
    with pytest.raises(BadFile, match=f"in {name}, which is not supported"):
        open_events(written(tmp_path / "a.raw", bytes(range(200)), f"% format {name};height=48;width=64\n% end\n"))


def test_bytes_that_are_no_words_are_refused(tmp_path):
    noise = np.random.default_rng(0).integers(0, 256, 100_000, np.uint8).tobytes()
    with pytest.raises(BadFile, match="of no known format"):
        open_events(written(tmp_path / "a.raw", noise))
    with pytest.raises(BadFile, match="does not tell its encoding"):
        open_events(written(tmp_path / "b.raw", noise, "% integrator_name Prophesee\n"))


def test_damage_is_counted_and_said(tmp_path, kind, encoded, some_events):
    """Not only the next events: all that follow keep their times."""
    events = some_events(5000)
    words, places = getattr(encoded, kind)(events)
    top = 8 * words.itemsize - 4
    highs = np.flatnonzero(words >> top == 8)
    words[highs[len(highs) // 2]] ^= 1 << (top - 2)
    path = written(tmp_path / "a.raw", words, new_header(kind))
    opened = open_events(path)
    with pytest.warns(EvimoWarning, match="events beside damaged words are lost"):
        found = joined(list(opened))
    gone = highs[len(highs) // 2], highs[len(highs) // 2 + 1]
    first, last = np.searchsorted(places, gone)
    assert opened.faults.damaged == last - first > 0
    assert found.t.tolist() == np.delete(events.t, np.s_[first:last]).tolist()
    assert opened.stop_us == events.t[-1] + 1


@pytest.mark.parametrize("zeros", [2, 17, 4096])
@pytest.mark.parametrize("kept", [0, 3_000])
def test_a_hole_in_evt2_is_no_events_of_the_corner(tmp_path, encoded, some_events, zeros, kept):
    """Zeros, as of a file that was copied in part, are words of pixel 0, 0; after them the clock is not known."""
    events = some_events(5000)
    words, places = encoded.evt2(events)
    at, highs = places[2000], np.flatnonzero(words >> 28 == 8)
    again = highs[np.searchsorted(highs, at + kept)]
    holed = np.concatenate((words[:at], np.zeros(zeros, "<u4"), words[at + kept :]))
    opened = open_events(written(tmp_path / "a.raw", holed, new_header("evt2")))
    with pytest.warns(EvimoWarning, match="events beside damaged words are lost"):
        found = joined(list(opened))
    gone = (places >= at) & (places < again)
    assert found.t.tolist() == events.t[~gone].tolist()
    assert opened.faults.damaged == zeros + again - at - kept


@pytest.mark.parametrize("span_us", [1_000, 400_000, 60_000_000])
def test_what_simulate_writes_is_read_back(tmp_path, some_events, rows, span_us):
    events = some_events(2000, span_us=span_us)
    save_events([events.part(0, 5), events.part(5, 5), events.part(5, 2000)], tmp_path / "a.raw", size=(48, 64))
    opened = open_events(tmp_path / "a.raw")
    assert opened.sensor == (48, 64) and rows(opened) == rows([events]) and opened.faults.dropped == 0


def test_a_few_events_far_apart_are_read_back(tmp_path):
    t = np.array([0, 7_000_000, 7_000_001, 900_000_000, 5_000_000_000])
    events = Events(np.arange(5, dtype=np.uint16), np.arange(5, dtype=np.uint16), t, np.ones(5, np.int8))
    save_events([events], tmp_path / "a.raw", size=(48, 64))
    opened = open_events(tmp_path / "a.raw")
    assert joined(list(opened)).t.tolist() == t.tolist() and opened.stop_us == t[-1] + 1


def test_the_suffix_does_not_matter(tmp_path, kind, encoded, events):
    with pytest.warns(EvimoWarning, match=re.escape("a.bin holds a Prophesee RAW recording by its content")):
        assert sum(map(len, open_events(raw_file(tmp_path / "a.bin", encoded, kind, events)))) == len(events)
