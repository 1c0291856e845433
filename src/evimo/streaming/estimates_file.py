"""`estimates.h5`: the maps of every slice in sensor pixels, compressed by a thread of their own."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.recordings.estimate import Estimate
from evimo.recordings.hdf5_file import Hdf5File
from evimo.streaming.stopwatch import Stopwatch
from evimo.streaming.threads import Background

GROWTH = 256  # slices by which the file grows at a time
PER_SLICE = {
    "t_us": "µs, the slice's centre in the recording's own time",
    "has_events": "False: the slice has no events, nothing is known of it, its maps say nothing and ego is NaN",
    "ego": "camera twist relative to the static world, camera axes: vx vy vz in mean depths/s, wx wy wz in rad/s",
    "moving_probability": "255 x probability that the pixel shows something that moves by itself",
    "ids": "0 background, else the number in column `object` of objects.csv",
    "rel_depth": "depth along the optical axis, in mean depths",
    "confidence": "255 x confidence in the flow: how much the pixel counted when the motions were fitted to it",
}

OF_OBJECTS = ("moving_probability", "ids")


class EstimatesFile:
    """Writes estimates to one HDF5 file; `close` waits for the last one.

    Datasets, N slices of (H, W) sensor pixels: `t_us` (N,) int64, `has_events` (N,) bool, `ego` (N, 6) float64,
    `moving_probability` (N, H, W) uint8, `ids` (N, H, W) uint8, `rel_depth` (N, H, W) float16, `confidence` (N, H, W)
    uint8, and `valid` (H, W) bool, the same for all slices. One slice is one gzip chunk. Each dataset says its unit
    and meaning in its attribute `meaning`. `moving_probability` and `ids` are missing where the model does not estimate
    what moves.
    """

    def __init__(
        self,
        path: Path,
        valid: NDArray[np.bool_],
        *,
        attributes: dict[str, str],
        watch: Stopwatch | None = None,
        objects: bool = True,
    ) -> None:
        """Start the file.

        Args:
            path: of the new file.
            valid: (H, W) as in every estimate that will come.
            attributes: of the file, such as the model's name.
            watch: counts the writing as stage `maps`.
            objects: whether estimates say what moves.
        """
        self._watch = watch or Stopwatch()
        self._file = Hdf5File(path, attributes=attributes)
        of_valid = self._file.content.create_dataset("valid", data=valid, compression="gzip")
        of_valid.attrs["meaning"] = "sensor pixels that have a place in the rectified image; elsewhere maps say nothing"
        self._datasets = {
            "t_us": self._dataset("t_us", (), np.int64),
            "has_events": self._dataset("has_events", (), np.bool_),
            "ego": self._dataset("ego", (6,), np.float64),
            **({name: self._dataset(name, valid.shape, np.uint8) for name in OF_OBJECTS} if objects else {}),
            "rel_depth": self._dataset("rel_depth", valid.shape, np.float16),
            "confidence": self._dataset("confidence", valid.shape, np.uint8),
        }
        self._count = 0
        self._writer = Background(self._append)

    def write(self, estimate: Estimate) -> None:
        """Hand over one slice."""
        self._writer.put(estimate)

    def close(self) -> None:
        """Wait until all is written, and finish the file."""
        try:
            self._writer.close()
            for dataset in self._datasets.values():
                dataset.resize(self._count, axis=0)
        finally:
            self._file.close()

    def _dataset(self, name: str, shape: tuple[int, ...], dtype: Any) -> Any:
        packing: dict[str, Any] = {"chunks": (GROWTH, *shape)}
        if len(shape) == 2:
            packing = {"chunks": (1, *shape), "compression": "gzip", "compression_opts": 1, "shuffle": True}
        dataset = self._file.content.create_dataset(name, (0, *shape), dtype, maxshape=(None, *shape), **packing)
        dataset.attrs["meaning"] = PER_SLICE[name]
        return dataset

    def _append(self, estimate: Estimate) -> None:
        with self._watch.stage("maps"):
            self._put(estimate)
            self._file.check()
        self._count += 1

    def _put(self, estimate: Estimate) -> None:
        if self._count % GROWTH == 0:
            for dataset in self._datasets.values():
                dataset.resize(self._count + GROWTH, axis=0)
        values: dict[str, Any] = {
            "t_us": estimate.t_us,
            "has_events": estimate.has_events,
            "ego": estimate.ego,
            "rel_depth": estimate.rel_depth.astype(np.float16),
            "confidence": _of_255(estimate.confidence),
        }
        if estimate.moving_probability is not None:
            values |= {"moving_probability": _of_255(estimate.moving_probability), "ids": estimate.ids}
        for name, value in values.items():
            self._datasets[name][self._count] = value


def _of_255(share: NDArray[np.float32]) -> NDArray[np.uint8]:
    return np.rint(share * 255).astype(np.uint8)
