"""An .npz file with masks or ids of objects for each instant."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile
from evimo.formats.array_rows import Rows
from evimo.formats.npz_members import Archive
from evimo.predictions.sources import Predictions, ascending_us, check_size
from evimo.recordings.prediction import Prediction

TIMES = ("times", "times_us", "t_us")
FIX = (
    "`masks` (N, H, W), bool or probabilities 0 to 1, or `ids` (N, H, W) of whole numbers, or both, and `times` (N,):"
    " whole µs, or seconds as float numbers; for labels of events `labels` (N,)"
)


def holds_maps(archive: Archive) -> bool:
    """Whether there are masks or ids in it."""
    return bool({"masks", "ids"} & archive.names)


def open_archive(archive: Archive, sensor: tuple[int, int]) -> Predictions:
    """Open an .npz file of maps: `masks` or `ids` or both (N, H, W), and `times` (N,).

    Raises:
        BadFile: an array is missing, or of another shape or type. BadInput: of another sensor.
    """
    path = archive.path
    name = next((name for name in TIMES if name in archive.names), None)
    if name is None:
        raise BadFile(f"{path} lacks `times`", fix=FIX)
    times_us = ascending_us(archive.whole(name), path, name=name)
    masks = Rows(archive, "masks", dimensions=3, kinds="biuf", fix=FIX) if "masks" in archive.names else None
    ids = Rows(archive, "ids", dimensions=3, kinds="iu", fix=FIX) if "ids" in archive.names else None
    for rows in (masks, ids):
        if rows is not None:
            check_size(rows.header.shape[1:], sensor, str(path))
            if len(rows) != len(times_us):
                raise BadFile(f"{path} has {len(rows)} maps and {len(times_us)} times", fix=FIX)
    what = " and ".join(name for name in ("masks", "ids") if name in archive.names)
    return Predictions(path=path, kind=f"npz, {what}", maps=_Archived(path, times_us, masks, ids))


class _Archived:
    """The maps of the file, streamed."""

    def __init__(self, path: Path, times_us: NDArray[np.int64], masks: Rows | None, ids: Rows | None) -> None:
        self.times_us = times_us
        self._path, self._masks, self._ids = path, masks, ids

    def at(self, k: int) -> Prediction:
        """Map k of each array."""
        mask = None if self._masks is None else self._masks.read(k, k + 1)[0]
        ids = None if self._ids is None else self._read_ids(self._ids, k)
        if mask is None:
            return Prediction(moving=None if ids is None else ids > 0, ids=ids)
        probability = None
        if mask.dtype.kind == "f":
            if not ((mask >= 0) & (mask <= 1)).all():
                raise BadFile(f"mask {k} of {self._path} has values outside 0 to 1", fix=FIX)
            probability, mask = mask.astype(np.float32), mask > 0.5
        elif mask.dtype.kind != "b" and (values := np.unique(mask)).size > 2 - (values[0] != 0):
            raise BadFile(f"mask {k} of {self._path} has more values than 0 and one other", fix=FIX)
        return Prediction(moving=mask > 0, ids=ids, probability=probability)

    def _read_ids(self, rows: Rows, k: int) -> NDArray[np.int32]:
        """The ids of map k; those that `Prediction` cannot hold would become others, or static."""
        ids = rows.read(k, k + 1)[0]
        if ids.max(initial=0) > (most := np.iinfo(np.int32).max):
            raise BadFile(f"ids {k} of {self._path} go beyond {most:,}", fix="smaller numbers for the objects")
        return ids.clip(0).astype(np.int32)
