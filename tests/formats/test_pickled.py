"""Pickles that Python itself made: plain ones come back as they were, and the others are refused unrun."""

import contextlib
import io
import os
import pickle
from collections import OrderedDict

import numpy as np
import pytest

from evimo.errors import BadFile
from evimo.formats.pickled import plain_value

VALUES = {
    "numbers": [0, 1, -1, 255, 256, 65536, 2**31, -(2**40), 2**64 - 1, 10**30, 0.5, -1e300, True, False, None],
    "words": ["", "cam", "ümlaut", "x" * 300, b"", b"bytes", b"\x80" * 300],
    "nested": {"a": {"b": ({"c": [1.5]}, (), (1,), (1, 2), (1, 2, 3), (1, 2, 3, 4))}, 3: []},
    "ordered": OrderedDict([("z", 1), ("a", 2)]),
    "sets": {1, 2},
}


@pytest.mark.parametrize("protocol", range(6))
def test_plain_values_come_back(protocol):
    values = {key: value for key, value in VALUES.items() if protocol >= 4 or key != "sets"}
    if protocol < 3:  # bytes are written as a call of a codec there
        values["words"] = [word for word in VALUES["words"] if isinstance(word, str)]
    shared = {"t": {"x": 1.0}}
    values |= {"one": shared, "two": shared}
    assert plain_value(io.BytesIO(pickle.dumps(values, protocol)), "it") == values


@pytest.mark.parametrize("protocol", [2, 3, 4, 5])
@pytest.mark.parametrize("kind", ["<f8", ">f4", "<u2", "u1", "bool", "<i8", "<U4", "S3"])
def test_arrays_and_scalars_come_back(protocol, kind):
    whole = np.arange(12).astype(kind).reshape(3, 4)
    values = {"a": whole, "f": np.asfortranarray(whole), "s": whole[2, 1], "list": [whole[0], (whole[1],)]}
    stream = io.BytesIO(pickle.dumps(values, protocol))
    found = plain_value(stream, "it")
    np.testing.assert_array_equal(found["a"], whole)
    np.testing.assert_array_equal(found["f"], whole)
    assert found["a"].dtype == whole.dtype
    assert found["s"] == whole[2, 1]
    np.testing.assert_array_equal(found["list"][1][0], whole[1])


def test_an_array_of_objects_is_what_it_holds():
    file = io.BytesIO()
    np.save(file, np.array({"frames": [np.float64(1.5)]}, object), allow_pickle=True)
    file.seek(128)
    assert plain_value(file, "it") == {"frames": [1.5]}
    assert plain_value(io.BytesIO(pickle.dumps(np.array([None, "a"], object))), "it") == [None, "a"]


class Evil:
    """Runs a command when it is unpickled."""

    def __init__(self, function, *arguments):
        self.call = function, arguments

    def __reduce__(self):
        return self.call


@pytest.mark.parametrize("protocol", range(6))
@pytest.mark.parametrize("place", ["alone", "in a list", "as an array's"])
def test_code_is_refused_and_not_run(tmp_path, protocol, place):
    trace = tmp_path / "ran"
    evil = Evil(os.system, f"touch {trace}")
    value = {"alone": evil, "in a list": [1, {"meta": evil}], "as an array's": np.array([evil], object)}[place]
    with pytest.raises(BadFile, match=r"system.*may run code: refused[\s\S]*try:"):
        plain_value(io.BytesIO(pickle.dumps(value, protocol)), "`meta` in film.npz")
    assert not trace.exists()


class Ordinary:
    """Any class that is not plain."""


@pytest.mark.parametrize("value", [Ordinary(), Evil(eval, "1"), Evil(getattr, {}, "x"), os.system, Ordinary, 1j])
def test_objects_and_functions_are_refused(value):
    for protocol in range(6):
        with pytest.raises(BadFile, match="refused"):
            plain_value(io.BytesIO(pickle.dumps(value, protocol)), "it")


@pytest.mark.parametrize(
    "program",
    [
        b"",  # nothing
        b".",  # takes what is not there
        b"\x80\x04N",  # no end
        b"\x80\x04)\x81.",  # NEWOBJ
        b"\x80\x04h\x05.",  # memory that was never filled
        b"(lp0\ng0\na.",  # a list in itself
        b"\x80\x02cnumpy\ndtype\n.",  # a name as the value
        b"\x80\x02cnumpy\nndarray\nK\x01\x85R.",  # a call that arrays do not make
        b"\x80\x02cnumpy\ndtype\nX\x03\x00\x00\x00V99\x85R.",
        b"P1\n.",  # a persistent id
        b"\x80\x02}]K\x01s.",  # a key that cannot be one
        b"\x80\x02K\x01K\x02a.",  # appends to a number
        b"i os\nsystem\n.",
        b"\x80\x02\x8a\xff" + b"\x01" * 9,  # a number that is longer than the file
    ],
)
def test_what_is_damaged_or_a_trick_is_one_error(program):
    if program.startswith(b"(lp0"):
        value = plain_value(io.BytesIO(program), "it")
        assert value[0] is value
        return
    with pytest.raises(BadFile):
        plain_value(io.BytesIO(program), "it")


def test_any_cut_and_any_flipped_byte_is_read_or_refused():
    rng = np.random.default_rng(0)
    whole = pickle.dumps(VALUES | {"a": np.arange(5.0), "s": np.float32(2)}, 4)
    for at in range(0, len(whole), 7):
        with pytest.raises(BadFile):
            plain_value(io.BytesIO(whole[:at]), "it")
    for _ in range(2000):
        spoilt = bytearray(whole)
        spoilt[rng.integers(len(spoilt))] = rng.integers(256)
        with contextlib.suppress(BadFile):
            plain_value(io.BytesIO(bytes(spoilt)), "it")


def test_what_multiplies_itself_takes_no_time_and_no_memory(monkeypatch):
    doubled = b"\x80\x02K\x01" + b"q\x00h\x00\x86" * 60 + b"."  # tuples of the same tuple twice: 2 to the 60 leaves
    found = plain_value(io.BytesIO(doubled), "it")
    for _ in range(60):
        assert found[0] is found[1]
        found = found[0]
    assert found == 1
    for key in (b"}" + doubled[2:-1] + b"Ns.", b"\x8f(" + doubled[2:-1] + b"\x90."):
        with pytest.raises(BadFile, match="key"):
            plain_value(io.BytesIO(b"\x80\x04" + key), "it")
    monkeypatch.setattr("evimo.formats.pickled.MOST_BYTES", 1000)
    call = b"c_codecs\nencode\nq\x00X\x64\x00\x00\x00" + b"a" * 100 + b"X\x06\x00\x00\x00latin1\x86q\x01R"
    with pytest.raises(BadFile, match="copies"):
        plain_value(io.BytesIO(b"\x80\x02" + call + b"h\x00h\x01R" * 20 + b"."), "it")
