"""Formats are recognised by content; what is no recording is refused in one clear sentence."""

import shutil

import numpy as np
import pytest

from evimo.errors import BadFile, EvimoWarning, NotFound
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


def test_folders_without_a_recording(tmp_path):
    with pytest.raises(BadFile, match="no EVIMO2 recording"):
        open_events(tmp_path)
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
    with pytest.raises(BadFile, match="holds no file of its bag"):
        open_events(tmp_path)


@pytest.mark.parametrize(
    "name, words",
    [
        ("formats/prophesee/evt2.raw", "Prophesee"),
        ("formats/prophesee/evt3.raw", "Prophesee recording .evt 3.0"),
        ("formats/prophesee/sample_ncars.dat", "Prophesee"),
        ("formats/prophesee/evt3_sample.npy", "NumPy array"),
        ("formats/hdf5/davis346_1s_dsec_style.h5", "HDF5"),
    ],
)
def test_real_files_of_later_formats_are_named(shared_data, name, words):
    with pytest.raises(BadFile, match=words):
        open_events(shared_data(name))
