"""Sensor sizes: as the user writes them, and guessed where a file does not tell."""

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile, BadInput, EvimoWarning

# (height, width), smallest first: DVS128, DAVIS240, ATIS, DVXplorer Lite, DAVIS346, HVGA, VGA, HD
NOWHERE = 65535
SAMSUNG = "samsung_mono"  # EVIMO2's folder of a camera that calls darker 1
KNOWN_SENSORS = ((128, 128), (180, 240), (240, 304), (240, 320), (260, 346), (320, 480), (480, 640), (720, 1280))


def sensor_size(written: str) -> tuple[int, int]:
    """(height, width) from "WxH", as in "346x260".

    Raises:
        BadInput: it is not two positive numbers joined by x.
    """
    match = re.fullmatch(r"\s*(\d+)\s*[xX×]\s*(\d+)\s*", written)
    if not match or min(width := int(match[1]), height := int(match[2])) < 1:
        raise BadInput(f"{written!r} is not a sensor size", fix="width x height in pixels, as in --sensor 346x260")
    return height, width


def size_in_words(sensor: tuple[int, int]) -> str:
    """Return a size as users write it, as in 346x260."""
    return f"{sensor[1]}x{sensor[0]}"


def whole_pixels(values: NDArray[Any]) -> NDArray[np.uint16]:
    """Return whole pixels, rounded; what cannot be one becomes 65535, which is outside every sensor."""
    if values.dtype.kind == "u" and values.dtype.itemsize <= 2:
        return values.astype(np.uint16)
    small = np.result_type(values.dtype, np.float16) == np.float16  # which 65535 overflows
    values = np.ascontiguousarray(values, np.float32 if small else None)
    if values.size and values.min() > -0.5 and values.max() < NOWHERE:  # as nearly always
        return (values if values.dtype.kind in "iu" else np.rint(values)).astype(np.uint16)
    inside = (values > -0.5) & (values < NOWHERE)
    return np.where(inside, np.rint(np.where(inside, values, 0)), NOWHERE).astype(np.uint16)


def extent_of(pixels: NDArray[np.uint16]) -> int:
    """One more than the largest column or row, but for those outside every sensor; 1 where there is none."""
    largest = int(pixels.max(initial=0))
    return (largest if largest < NOWHERE else int(pixels[pixels < NOWHERE].max(initial=0))) + 1


def fitting_sensor(extent: tuple[int, int]) -> tuple[int, int]:
    """Return the smallest known sensor that holds so many rows and columns; so many themselves, if none does."""
    height, width = extent
    return next((known for known in KNOWN_SENSORS if height <= known[0] and width <= known[1]), extent)


def assumed_sensor(path: Path, extent: tuple[int, int]) -> tuple[int, int]:
    """The smallest known sensor that holds every pixel of the file, with a warning that says so.

    Raises:
        BadFile: no known sensor is that large.
    """
    height, width = extent
    largest = f"largest column {width - 1}, largest row {height - 1}"
    for known in KNOWN_SENSORS:
        if height <= known[0] and width <= known[1]:
            warnings.warn(
                f"{path.name} does not tell its sensor's size: taken as {known[1]}x{known[0]}, "
                f"the smallest known sensor that holds all its events ({largest}); --sensor WxH sets it",
                EvimoWarning,
                stacklevel=2,
            )
            return known
    raise BadFile(f"{path.name} fits no known sensor: {largest}", fix="give its size with --sensor WxH")


def upright(path: Path, stored: tuple[int, int] | None, extent: tuple[int, int]) -> tuple[int, int] | None:
    """The size that a file tells, its sides swapped, with a warning, where only so it holds the events.

    Sensors are wider than high: where events fit only one that is higher, it may be their columns that are swapped.
    """
    if stored is None or stored[0] <= stored[1] or extent[1] <= stored[1]:
        return stored
    turned = stored[1], stored[0]
    if extent[0] > turned[0] or extent[1] > turned[1]:
        return stored
    text = f"{path.name} tells a sensor of {size_in_words(stored)}, and its events fit only one of"
    warnings.warn(f"{text} {size_in_words(turned)}: its sides are swapped", EvimoWarning, stacklevel=4)
    return turned


def on_sign(path: Path) -> int:
    """The sign of an event that is stored as 1: -1 in EVIMO2's folders of its Samsung camera."""
    return -1 if SAMSUNG in path.resolve().parts else 1
