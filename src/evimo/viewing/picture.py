"""Single pictures on disk."""

from pathlib import Path

import cv2

from evimo.errors import BadInput
from evimo.viewing.colours import Image


def save_picture(image: Image, path: str | Path) -> None:
    """Save an RGB image; the suffix says the format, folders are made.

    Raises:
        BadInput: the suffix names no format that OpenCV writes.
    """
    path = Path(path)
    if not path.suffix or not cv2.haveImageWriter(path.suffix):
        raise BadInput(f"{path.name} is no name of a picture", fix="end it with .png or .jpg")
    path.parent.mkdir(parents=True, exist_ok=True)
    _, written = cv2.imencode(path.suffix, cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
    path.write_bytes(written.tobytes())
