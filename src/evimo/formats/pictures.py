"""Pictures from files, those of damaged ones refused before memory is taken for what their headers claim."""

import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

PNG = struct.Struct(">8s4x4sIIBB")
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
    _, kind, width, height, depth, colours = PNG.unpack_from(raw)
    if kind != b"IHDR" or width * height > MOST_PIXELS:
        return False
    return width * height * depth * CHANNELS.get(colours, 1) // 8 <= DENSEST * len(raw)
