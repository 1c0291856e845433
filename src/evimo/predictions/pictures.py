"""A folder of PNG pictures: one mask, or one map of ids, for each instant."""

import csv
import re
import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile
from evimo.formats.pictures import read_picture
from evimo.predictions.sources import Predictions, ascending_us, check_size
from evimo.recordings.prediction import Prediction

TIMES = "times.csv"
PNG = b"\x89PNG\r\n\x1a\n"
MASK = 255
"""The value of a mask that names no objects."""
MOST_VALUES = 64
"""Of one picture: with more it is a probability or a photograph."""
NAMING = f"name them by time in µs, such as 000012500.png, or add {TIMES} with lines of name,time"


def holds_pictures(folder: Path) -> bool:
    """Whether there are PNG pictures in it, or a list of some."""
    return bool(_pictures_in(folder)) or (folder / TIMES).is_file()


def open_pictures(folder: Path, sensor: tuple[int, int]) -> Predictions:
    """Open a folder of PNG masks, named by time in µs or listed in `times.csv`.

    Nonzero is moving, every value of its own an object; a picture of 0 and 255 alone is a mask without names.

    Raises:
        BadFile: no picture, or no time for one.
    """
    times = _listed(folder) if (folder / TIMES).is_file() else _named(folder)
    paths = sorted(times, key=times.__getitem__)
    return Predictions(
        path=folder, kind="PNG masks", maps=_Pictures(paths, np.array([times[path] for path in paths]), folder, sensor)
    )


class _Pictures:
    """The pictures in the order of their times."""

    def __init__(self, paths: list[Path], times: NDArray[np.number], folder: Path, sensor: tuple[int, int]) -> None:
        self.times_us = ascending_us(times, folder)
        self._paths, self._sensor = paths, sensor

    def at(self, k: int) -> Prediction:
        """Decode the picture of instant k."""
        path = self._paths[k]
        check_size(_told_size(path), self._sensor, str(path))  # before memory is taken for what a damaged one says
        picture = read_picture(path)
        if picture is None:
            raise BadFile(f"{path} is no PNG picture, or damaged", fix="write it again")
        if picture.ndim == 3 and (picture == picture[..., :1]).all():
            picture = picture[..., 0]
        check_size(picture.shape[:2], self._sensor, str(path))
        if picture.ndim != 2:
            raise BadFile(
                f"{path} has colours", fix="one channel: 0 where nothing moves, else a number for each object"
            )
        values = np.unique(picture)
        if len(values) > MOST_VALUES:
            raise BadFile(
                f"{path} has {len(values)} different values: neither a mask nor ids of objects",
                fix="0 and 255 for a mask; an npz with `masks` of float numbers, 0 to 1, for probabilities",
            )
        nameless = values[-1] == MASK
        if nameless and values[values > 0].size > 1:
            raise BadFile(
                f"{path} has {MASK} beside other values than 0: a probability, or a border that is not to be scored?",
                fix=f"0 and {MASK} for a mask; other numbers for objects; what is not sure as 0",
            )
        ids = None if nameless else picture.astype(np.int32)
        return Prediction(moving=picture > 0, ids=ids)


def _told_size(path: Path) -> tuple[int, int]:
    """(height, width) by the header of a PNG picture.

    Raises:
        BadFile: it has none.
    """
    with path.open("rb") as file:
        head = file.read(len(PNG) + 16)
    if not head.startswith(PNG) or len(head) < len(PNG) + 16:
        raise BadFile(f"{path} is no PNG picture, or damaged", fix="write it again")
    width, height = struct.unpack_from(">2I", head, len(PNG) + 8)
    return height, width


def _pictures_in(folder: Path) -> list[Path]:
    named = (path for path in folder.iterdir() if path.suffix.lower() == ".png" and not path.name.startswith("."))
    return [path for path in named if path.is_file()]


def _named(folder: Path) -> dict[Path, int]:
    """Times by the digits at the end of the names."""
    times: dict[Path, int] = {}
    for path in _pictures_in(folder):
        digits = re.search(r"(\d{1,18})$", path.stem)
        if digits is None:
            raise BadFile(f"{path} does not say of what time it is", fix=NAMING)
        times[path] = int(digits[1])
    return times


def _listed(folder: Path) -> dict[Path, float]:
    """Times by the list, whole numbers in µs, or in seconds if any has a fraction."""
    path = folder / TIMES
    times: dict[Path, float] = {}
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            lines = [[cell.strip() for cell in line] for line in csv.reader(file) if any(line)]
        lines = [line for line in lines if any(cell.lower().endswith(".png") for cell in line)]
        in_seconds = any("." in time or "e" in time.lower() for _, time in lines)
        for name, time in lines:
            times[folder / name] = float(time) if in_seconds else int(time)
    except (ValueError, csv.Error) as error:
        raise BadFile(f"{path} has a line that is not name,time", fix="lines such as 000012500.png,12500") from error
    if missing := [file for file in times if not file.is_file()]:
        raise BadFile(f"{path} lists {missing[0].name}, which is not there, and {len(missing) - 1} more", fix=NAMING)
    if not times:
        raise BadFile(f"{path} lists no picture", fix=NAMING)
    return times
