"""Pictures that claim to be larger than their bytes can hold take no memory."""

import struct
import tracemalloc
import zlib

import cv2
import numpy as np
import pytest

from evimo.formats.pictures import read_picture


def test_any_whole_picture_is_read(tmp_path):
    rng = np.random.default_rng(0)
    for number, kind in enumerate((np.uint8, np.uint16)):
        for shape in ((20, 30), (20, 30, 3)):
            pixels = rng.integers(0, np.iinfo(kind).max, shape, kind)
            path = tmp_path / f"Bärte {number}{len(shape)}.png"
            path.write_bytes(cv2.imencode(".png", pixels)[1].tobytes())
            np.testing.assert_array_equal(read_picture(path), pixels)
    path.write_bytes(cv2.imencode(".png", np.zeros((4000, 4000, 3), np.uint16))[1].tobytes())
    assert not read_picture(path).any()  # the densest that there is


@pytest.mark.parametrize("size", [(30_000, 30_000), (3_000, 3_000), (0, 7)])
def test_a_size_that_cannot_be_is_damage(tmp_path, size):
    whole = bytearray(cv2.imencode(".png", np.zeros((20, 30, 3), np.uint16))[1].tobytes())
    whole[16:24] = struct.pack(">II", *size)
    whole[29:33] = struct.pack(">I", zlib.crc32(whole[12:29]))
    (tmp_path / "a.png").write_bytes(whole)
    tracemalloc.start()
    assert read_picture(tmp_path / "a.png") is None
    assert tracemalloc.get_traced_memory()[1] < 1_000_000
    tracemalloc.stop()
    assert read_picture(tmp_path / "none.png") is None


def test_a_header_whose_sum_is_wrong_is_not_decoded(tmp_path, monkeypatch):
    """OpenCV took 2 GB for a picture of 252 bytes in whose header bytes were put in."""
    whole = cv2.imencode(".png", np.zeros((20, 30, 3), np.uint16))[1].tobytes()
    decoded = []
    monkeypatch.setattr(cv2, "imdecode", lambda *_: decoded.append(True))
    for at in range(8, 33):
        (tmp_path / "a.png").write_bytes(whole[:at] + b"\0\0\0" + whole[at:])
        assert read_picture(tmp_path / "a.png") is None
    assert not decoded


@pytest.mark.parametrize(("at", "length"), [(33, 1 << 29), (33, 0xFFFFFFF0), (-12, 1 << 28)])
def test_a_chunk_longer_than_its_file_is_not_decoded(tmp_path, monkeypatch, at, length):
    """OpenCV took 512 MB for a picture of 253 bytes whose first chunk of pixels said that it had as many."""
    whole = bytearray(cv2.imencode(".png", np.zeros((20, 30, 3), np.uint16))[1].tobytes())
    place = at % len(whole)
    whole[place : place + 4] = struct.pack(">I", length)
    decoded = []
    monkeypatch.setattr(cv2, "imdecode", lambda *_: decoded.append(True))
    for raw in (whole, whole[: place + 6], whole[:40]):
        (tmp_path / "a.png").write_bytes(raw)
        assert read_picture(tmp_path / "a.png") is None
    assert not decoded
