"""What `evimo run` leaves: `estimates.h5`, and beside it the velocities of objects in `objects.csv`."""

import csv
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile
from evimo.formats.hdf5_file import opened_hdf5
from evimo.predictions.sources import Predictions, ascending_us, check_size
from evimo.recordings.prediction import Prediction, velocity_map

ESTIMATES, EVENTS, OBJECTS = "estimates.h5", "events.h5", "objects.csv"
MAPS = ("moving_probability", "ids", "rel_depth")
OF_OBJECTS = ("moving_probability", "ids")
"""Both are there, or neither is: then the program does not say what moves."""
KINDS = {
    "moving_probability": "u",
    "ids": "u",
    "rel_depth": "f",
    "t_us": "i",
    "ego": "f",
    "valid": "b",
    "has_events": "b",
}
DAMAGED = "run again: evimo run RECORDING --dense"
VELOCITY = ("rel_vx", "rel_vy", "rel_vz")


def opened_h5(path: Path) -> h5py.File:
    """An HDF5 file.

    Raises:
        BadFile: it is none, or cut short.
    """
    try:
        return opened_hdf5(path)
    except OSError as error:
        raise BadFile(f"{path} is no HDF5 file, or damaged", fix=DAMAGED) from error


@contextmanager
def sound(path: Path) -> Generator[None]:
    """Turn what h5py says of damage into our error.

    Raises:
        BadFile: something in the file is damaged.
    """
    try:
        yield
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
        raise BadFile(f"{path} is damaged: {error}", fix=DAMAGED) from error


def facts_of(file: h5py.File) -> dict[str, str]:
    """What the file tells of the recording and of the model: its name, and its hash or its parameters.

    Raises:
        BadFile: it is damaged.
    """
    with sound(Path(file.filename)):
        wanted = [name for name in file.attrs if name == "recording" or name.startswith("model")]
        return {name: str(file.attrs[name]) for name in wanted}


def open_estimates(path: Path, sensor: tuple[int, int]) -> Predictions:
    """Open `estimates.h5`; where `objects.csv` lies beside it, objects have velocities, too.

    Raises:
        BadFile: damaged, or without a dataset. BadInput: of another sensor.
    """
    file = opened_h5(path)
    maps = _Estimates(path, file, sensor)
    return Predictions(path=path, kind=ESTIMATES, maps=maps, facts=facts_of(file))


class _Estimates:
    """The slices of the file."""

    def __init__(self, path: Path, file: h5py.File, sensor: tuple[int, int]) -> None:
        self._path = path
        with sound(path):
            self._says_what_moves = any(name in file for name in OF_OBJECTS)
        left_out = () if self._says_what_moves else OF_OBJECTS
        self._data = {name: self._dataset(file, name) for name in KINDS if name not in left_out}
        maps = [name for name in MAPS if name not in left_out]
        self.times_us = ascending_us(self._read("t_us", ...), path, name="t_us")
        for name in maps:
            check_size(self._data[name].shape[1:], sensor, f"`{name}` of {path}")
        lengths = {self._data[name].shape[:1] for name in (*maps, "ego", "has_events")}
        if lengths != {self.times_us.shape} or self._data["ego"].shape[1:] != (6,):
            raise BadFile(f"the datasets of {path} do not fit together", fix=DAMAGED)
        self._valid: NDArray[np.bool_] = self._read("valid", ...).astype(np.bool_)
        check_size(self._valid.shape, sensor, f"`valid` of {path}")
        table = path.parent / OBJECTS
        self._velocities = _Velocities(table) if table.is_file() else None

    def at(self, k: int) -> Prediction:
        """Slice k; ids count where the mask is valid."""
        if not self._read("has_events", k):
            return Prediction(has_events=False)
        rel_depth, ego = self._read("rel_depth", k), self._read("ego", k).astype(np.float64)
        if not np.isfinite(ego).all() or not np.isfinite(rel_depth[self._valid]).all():
            raise BadFile(f"slice {k} of {self._path} holds numbers that are not finite", fix=DAMAGED)
        said = Prediction(rel_depth=rel_depth.astype(np.float32), ego=ego, valid=self._valid)
        return self._with_objects(said, k) if self._says_what_moves else said

    def _with_objects(self, said: Prediction, k: int) -> Prediction:
        of_255, ids = (self._read(name, k) for name in OF_OBJECTS)
        ids = np.where(self._valid, ids, 0).astype(np.int32)
        objects = None if self._velocities is None else self._velocities.at(int(self.times_us[k]))
        return replace(
            said,
            moving=(of_255 > 127.5) & self._valid,
            ids=ids,
            probability=of_255.astype(np.float32) / np.float32(255),
            velocity=None if objects is None else velocity_map(ids, objects),
        )

    def _dataset(self, file: h5py.File, name: str) -> Any:
        with sound(self._path):
            dataset = file.get(name)
            if isinstance(dataset, h5py.Dataset) and dataset.dtype.kind == KINDS[name]:
                return dataset
        raise BadFile(f"{self._path} lacks `{name}`, or holds it in another type", fix=DAMAGED)

    def _read(self, name: str, at: Any) -> NDArray[Any]:
        with sound(self._path):
            return np.asarray(self._data[name][at])


class _Velocities:
    """The velocities of objects, read slice by slice."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._slices = self._read()
        self._ahead = next(self._slices, None)

    def at(self, t_us: int) -> dict[int, NDArray[np.float64]]:
        """Those of a slice by the object's number; times must ascend."""
        while self._ahead is not None and self._ahead[0] < t_us:
            self._ahead = next(self._slices, None)
        return self._ahead[1] if self._ahead is not None and self._ahead[0] == t_us else {}

    def _read(self) -> Iterator[tuple[int, dict[int, NDArray[np.float64]]]]:
        with self._path.open(newline="", encoding="utf-8") as file:
            try:
                for t_us, rows in groupby(csv.DictReader(file), key=lambda row: int(row["t_us"])):
                    yield t_us, {int(row["object"]): np.array([float(row[name]) for name in VELOCITY]) for row in rows}
            except (KeyError, TypeError, ValueError, csv.Error) as error:
                raise BadFile(f"{self._path} is no table of objects: {error}", fix=DAMAGED) from error
