"""Opening of HDF5 files, against heads that the library writes."""

import struct

import h5py
import numpy as np
import pytest

from evimo.formats.hdf5_file import opened_hdf5


def written(path, *, block=0, version="earliest"):
    with h5py.File(path, "w", libver=version, userblock_size=block) as file:
        file["a"] = 3
    return path


@pytest.mark.parametrize("block", [0, 512, 2048])
@pytest.mark.parametrize("version", ["earliest", "v110", "latest"])
def test_heads_of_all_versions_and_places_are_opened(tmp_path, version, block):
    with opened_hdf5(written(tmp_path / "a.h5", block=block, version=version)) as file:
        assert file["a"][()] == 3


@pytest.mark.parametrize("block", [0, 1024])
def test_a_head_that_names_a_driver_is_damaged(tmp_path, block):
    path = written(tmp_path / "a.h5", block=block)
    raw = bytearray(path.read_bytes())
    assert struct.unpack_from("<Q", raw, block + 48) == (2**64 - 1,)
    struct.pack_into("<Q", raw, block + 48, 0x60)
    path.write_bytes(raw)
    with pytest.raises(OSError, match="names a driver"):
        opened_hdf5(path)


@pytest.mark.parametrize("content", [b"", b"\x89HDF\r\n\x1a\n", bytes(3000)])
def test_what_is_no_hdf5_is_said_by_the_library(tmp_path, content):
    (tmp_path / "a.h5").write_bytes(content)
    with pytest.raises(OSError, match="open file"):
        opened_hdf5(tmp_path / "a.h5")


@pytest.mark.parametrize("before", [0, 3_000_000])
@pytest.mark.parametrize("content", [0, 2**64 - 16, 1 << 40])
def test_a_heap_of_strings_that_would_be_read_for_ever_is_damaged(tmp_path, before, content):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["before"] = np.zeros(before, np.uint8)
        file.attrs["words"] = ["some", "words of any length"]
    with opened_hdf5(path) as file:
        assert list(file.attrs["words"]) == ["some", "words of any length"]
    raw = bytearray(path.read_bytes())
    heap = raw.index(b"GCOL")
    struct.pack_into("<Q", raw, heap + 16 + 24 + 40 + 8, content)  # behind 4 and 19 bytes: the room left
    path.write_bytes(raw)
    with pytest.raises(OSError, match="heap of strings is damaged"):
        opened_hdf5(path)
