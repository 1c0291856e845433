"""`events.h5`: the events of every slice and the object each belongs to, compressed by a thread of their own."""

from pathlib import Path
from typing import Any

import numpy as np

from evimo.recordings.estimate import EventLabels
from evimo.recordings.hdf5_file import Hdf5File
from evimo.streaming.stopwatch import Stopwatch
from evimo.streaming.threads import Background

CHUNK = 65_536  # events
COLUMNS: dict[str, tuple[Any, str]] = {
    "t_us": (np.int64, "µs in the recording's own time"),
    "x": (np.uint16, "column on the sensor, px"),
    "y": (np.uint16, "row on the sensor, px"),
    "p": (np.int8, "polarity: 1 brighter, -1 darker"),
    "object": (np.uint8, "0 background, else the number in column `object` of objects.csv"),
}


class EventsFile:
    """Writes labelled events to one HDF5 file; `close` waits for the last one.

    Datasets, one row per event in order of time: `t_us` (N,) int64, `x`, `y` (N,) uint16, `p` (N,) int8 and `object`
    (N,) uint8, in gzip chunks. Each says its unit and meaning in its attribute `meaning`.
    """

    def __init__(self, path: Path, *, attributes: dict[str, str], watch: Stopwatch | None = None) -> None:
        """Start the file.

        Args:
            path: of the new file.
            attributes: of the file, such as the model's name.
            watch: counts the writing as stage `events`.
        """
        self._watch = watch or Stopwatch()
        self._file = Hdf5File(path, attributes=attributes)
        self._datasets = {name: self._dataset(name) for name in COLUMNS}
        self._count = 0
        self._writer = Background(self._append)

    def write(self, labels: EventLabels) -> None:
        """Hand over the events of one slice."""
        self._writer.put(labels)

    def close(self) -> None:
        """Wait until all is written, and finish the file."""
        try:
            self._writer.close()
        finally:
            self._file.close()

    def _dataset(self, name: str) -> Any:
        dtype, meaning = COLUMNS[name]
        packing: dict[str, Any] = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
        dataset = self._file.content.create_dataset(name, (0,), dtype, maxshape=(None,), chunks=(CHUNK,), **packing)
        dataset.attrs["meaning"] = meaning
        return dataset

    def _append(self, labels: EventLabels) -> None:
        with self._watch.stage("events"):
            self._put(labels)
            self._file.check()

    def _put(self, labels: EventLabels) -> None:
        events = labels.events
        before, self._count = self._count, self._count + len(events)
        for name, column in zip(COLUMNS, (events.t, events.x, events.y, events.p, labels.objects), strict=True):
            self._datasets[name].resize(self._count, axis=0)
            self._datasets[name][before : self._count] = column
