"""Pictures from files, those of damaged ones refused before memory is taken for what their headers claim."""

import struct
import zlib
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

PNG = struct.Struct(">8sI4sIIBB3xI")  # up to the checksum of its header
CHUNK, CHECKSUM_BYTES, FIRST_CHUNK = struct.Struct(">I4s"), 4, 8  # length and kind of a chunk; where the first begins
HEADER = slice(12, 29)  # what that sum is of
CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}  # by the type of colours
DENSEST = 1100  # bytes of pixels from one byte of a PNG: deflate cannot pack more
MOST_PIXELS = 100_000_000


def read_picture(path: Path, flags: int = cv2.IMREAD_UNCHANGED) -> NDArray[Any] | None:
    """Return the pixels of a picture as OpenCV has them; None where there is none or it is damaged."""
    raw = path.read_bytes() if path.is_file() else b""
    if not raw or not _is_possible(raw):
        return None
    try:
        return cv2.imdecode(np.frombuffer(raw, np.uint8), flags)
    except cv2.error:  # of a size that OpenCV refuses
        return None


def _is_possible(raw: bytes) -> bool:
    """Whether a PNG of so many bytes can have the size that its header tells; of other formats OpenCV decides."""
    if len(raw) < PNG.size or not raw.startswith(b"\x89PNG"):
        return True
    _, length, kind, width, height, depth, colours, told = PNG.unpack_from(raw)
    if kind != b"IHDR" or length != 13 or zlib.crc32(raw[HEADER]) != told:
        return False  # OpenCV goes on with what it takes for a size
    if not 0 < width * height <= MOST_PIXELS or not _is_whole(raw):
        return False
    return width * height * depth * CHANNELS.get(colours, 1) // 8 <= DENSEST * len(raw)


def _is_whole(raw: bytes) -> bool:
    """Whether the chunks of a PNG lie within it up to its end: OpenCV takes as much memory as a chunk says it has."""
    at, kind = FIRST_CHUNK, b""
    while kind != b"IEND":
        if at + CHUNK.size > len(raw):
            return False
        length, kind = CHUNK.unpack_from(raw, at)
        at += CHUNK.size + length + CHECKSUM_BYTES
    return at <= len(raw)
