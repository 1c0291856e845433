"""Single pictures on disk."""

from pathlib import Path

import cv2

from evimo.errors import BadInput
from evimo.viewing.colours import Image
from evimo.writing import new_file


def save_picture(image: Image, path: str | Path) -> None:
    """Save an RGB image; the suffix says the format, folders are made.

    Raises:
        BadInput: the suffix names no format that OpenCV writes, the file cannot be written, or the disk is full.
    """
    path = Path(path)
    content = picture_file(image, path)
    with new_file(path) as file:
        file.write_bytes(content)


def picture_file(image: Image, path: Path) -> bytes:
    """The content of a file of that name which shows an RGB image.

    Raises:
        BadInput: the suffix names no format that OpenCV writes.
    """
    if not path.suffix or not cv2.haveImageWriter(path.suffix):
        raise BadInput(f"{path.name} is no name of a picture", fix="end it with .png or .jpg")
    _, written = cv2.imencode(path.suffix, cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
    return written.tobytes()
