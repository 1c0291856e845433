"""Formats are recognised by content; what is no recording is refused in one clear sentence."""

import gzip
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from evimo.errors import BadFile, BadInput, EvimoWarning, NotFound
from evimo.formats import open_events


@pytest.fixture
def recording(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("0,5,6,1\n4,7,8,0\n")
    return path


def test_a_wrong_suffix_is_ignored_with_a_warning(recording, tmp_path):
    np.savez(tmp_path / "b.npz", events=np.array([[0, 5, 6, 1], [4e-6, 7, 8, 0]]))
    for source, name in ((recording, "c.es"), (tmp_path / "b.npz", "d.aedat4"), (tmp_path / "b.npz", "e")):
        shutil.copy(source, tmp_path / name)
        with pytest.warns(EvimoWarning, match="its suffix .* is ignored"):
            opened = open_events(tmp_path / name, sensor=(48, 64))
        assert sum(map(len, opened)) == 2


def test_a_right_suffix_warns_of_nothing(recording, recwarn):
    open_events(recording, sensor=(48, 64))
    open_events(str(recording), sensor=(48, 64))
    assert not recwarn.list


def test_nothing_there():
    with pytest.raises(NotFound, match=r"there is no .*gone\.es"):
        open_events("gone.es")


@pytest.mark.parametrize(
    "content, words",
    [
        (b"", "empty"),
        (b"#!AER-DAT2.0\r\n# This is a raw AE data file\r\n\0\1\2", "ends before its first record"),
        (b"#!AER-DAT3.1\r\n", "holds no events"),
        (b"#!AER-DAT1.0\r\n", "AEDAT 1.*not supported yet"),
        (b"\x89HDF\r\n\x1a\n", "HDF5.*damaged"),
        (b"SQLite format 3\0", "damaged ROS 2 bag, db3"),
        (b"\x89MCAP0\r\n", "damaged ROS 2 bag, mcap"),
        (b"\x93NUMPY\x01\0", "NumPy array"),
        (b"% date 2023-10-19\n% evt 3.0\n% end\n\0\x80\1\x60", "holds no events"),
        (b"% Data file containing CD events.\n% Version 2\n\0\x08\0\0\0\0", "holds no events"),
        (b"\x1f\x8b\x08\0", "gzip"),
        (gzip.compress(b"", mtime=0), "compressed with gzip, and holds nothing"),
        (b"\x50\x2a\x4d\x18\0\0\0\0", "compressed with zstd, and holds nothing"),
        (b"\x04\x22\x4d\x18\0\0", "compressed with lz4"),
        (b"PK\x05\x06" + bytes(18), "an empty zip archive"),
        (b"MATLAB 5.0 MAT-file, Platform: GLNXA64" + bytes(100), "a MATLAB file"),
        (b'{"t": 1, "x": 2, "y": 3, "p": 1}\n', "a JSON file, no recording"),
        (b"\x89PNG\r\n\x1a\n\0\0", "picture"),
        (b"\0\0\0 ftypisom", "no known format"),
        (bytes(range(256)), "no known format"),
        ("Grüße, das ist kein Film.\n".encode(), "README, without a line of numbers"),
        (b"\x80\x04\x95\x1d\0\0\0", "pickle"),
        (b"PK\x03\x04 not a zip", "without NumPy arrays"),
        (b"Event Stream", "ends inside its header"),
        (b"#ROSBAG V2.0\n", "without a readable chunk"),
        (b"#!AER-DAT4.0\r\n", "head is cut short"),
    ],
)
def test_what_cannot_be_read_is_said_with_a_way_out(tmp_path, content, words):
    path = tmp_path / "a.bin"
    path.write_bytes(content)
    with pytest.raises(BadFile, match=rf"(?s)a\.bin.*{words}.*\n  try: ."):
        open_events(path)


@pytest.mark.parametrize("suffix", [".aedat4", ".raw", ".bag", ".h5", ".npz", ".es", ".txt", ".csv", ""])
@pytest.mark.parametrize(
    "content, words",
    [
        ("version https://git-lfs.github.com/spec/v1\noid sha256:ab\nsize 1\n", "a git-lfs pointer"),
        ("/annex/objects/SHA256E-s1--ab.h5\n", "a git-annex pointer"),
        ("\ufeff\n<!DOCTYPE html>\n<html><head><title>Drive</title>", "a web page"),
        ("<html>", "a web page"),
        ('<?xml version="1.0"?>\n<opencv_storage>', "an XML file"),
        ("%YAML:1.0\n---\nK: 1\n", "a YAML file"),
        ('{"error": "not found"}', "a JSON file"),
        ("# My data set\n\nDownload 1 2 3 4 files, then run it.\n", "a text, such as a README"),
        ("Not Found", "a text, such as a README"),
        ("# My data set\n\nDownload it.", "a text, such as a README"),
    ],
)
def test_what_stands_in_place_of_a_recording_is_called_that(tmp_path, suffix, content, words):
    path = tmp_path / f"recording{suffix}"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(BadFile, match=rf"recording\S* is {words}"):
        open_events(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are named pipes")
def test_a_pipe_is_refused_rather_than_waited_for(tmp_path):
    os.mkfifo(tmp_path / "recording.raw")
    for path in tmp_path / "recording.raw", Path(os.devnull):
        with pytest.raises(BadFile, match="is a pipe or a device"):
            open_events(path)
    with pytest.raises(BadFile, match="no EVIMO2 recording"):
        open_events(tmp_path)


@pytest.mark.parametrize("heading", ["99999 99999", "%geometry:90000,90000", "t,x@70000,y@70000,p"])
def test_a_size_of_no_sensor_is_not_believed(tmp_path, heading):
    path = tmp_path / "a.txt"
    path.write_text(f"{heading}\n0,1,2,1\n10,3,4,0\n")
    with pytest.raises(BadFile, match=r"the sensor that a\.txt tells of"):
        open_events(path)
    assert open_events(path, sensor=(48, 64)).sensor == (48, 64)


def test_an_option_that_means_nothing_for_a_file_is_said(tmp_path):
    (tmp_path / "a.txt").write_text("0 1 2 1\n10 3 4 0\n")
    with pytest.warns(EvimoWarning, match="--topic means nothing for it and is ignored"):
        open_events(tmp_path / "a.txt", sensor=(48, 64), topic="left")


def test_folders_without_a_recording(tmp_path):
    with pytest.raises(BadFile, match="no EVIMO2 recording"):
        open_events(tmp_path)
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
    with pytest.raises(BadFile, match="holds no file of its bag"):
        open_events(tmp_path)


@pytest.mark.parametrize(
    "name, words",
    [
        ("formats/prophesee/evt3_sample.npy", "NumPy array"),
    ],
)
def test_real_files_of_later_formats_are_named(shared_data, name, words):
    with pytest.raises(BadFile, match=words):
        open_events(shared_data(name))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        *(({"time_unit": unit}, "try: time_unit is one of s, ms, us, ns") for unit in ("min", "µs", 5)),
        *(({"columns": columns}, "does not name t, x, y and p") for columns in ("", "txy")),
    ],
)
def test_options_of_other_kinds_are_named(recording, options, words):
    with pytest.raises(BadInput, match=words):
        open_events(recording, **options)
