"""A torch Dataset of slices with truth, over recordings in any layout."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import Dataset

from evimo.errors import BadFile, BadInput
from evimo.events.slices import SLICE_US
from evimo.recordings.finding import recordings_in
from evimo.recordings.prepared import SUBPIXEL, Prepared, open_prepared, prepare
from evimo.recordings.splits import Part


class SliceSample(NamedTuple):
    """One slice of 25 ms in the rectified image (h, w), or B of them, whose events then begin with their place.

    events:      (N, 4) float32: x, y in px, time in s relative to the slice's centre, polarity -1 or +1; of a batch
                 (N, 5), the first column being the sample's place in it.
    depth:       (1, h, w) float32, m. depth_valid: (1, h, w) bool, where it is known; so is flow there.
    ids:         (1, h, w) uint8, objects; 0 is static. moving: (1, h, w) bool, of objects that move now.
    flow:        (2, h, w) float32, 1/s on the plane Z = 1.
    valid:       (1, h, w) bool, pixels that the lens sees.
    ego:         (6,) float32, the camera's twist, m/s and rad/s. intrinsics: (4,) float32, fx fy cx cy, px.
    """

    events: Tensor
    depth: Tensor
    depth_valid: Tensor
    ids: Tensor
    moving: Tensor
    flow: Tensor
    valid: Tensor
    ego: Tensor
    intrinsics: Tensor


class SliceDataset(Dataset[SliceSample]):
    """Every slice with truth of some recordings of EV-IMO, EVIMO2 or the simulator, at random places in a moment.

    Each recording is prepared once, beside itself, as for `evimo train`. Worker processes open files of their own.
    """

    def __init__(self, paths: str | Path | Sequence[str | Path], *, split: str = "", part: Part = "train") -> None:
        """Find and prepare the recordings.

        Args:
            paths: recordings, or folders that hold them.
            split: the name of a published split, of whose `part` only recordings are used.
            part: `train` or `test`.

        Raises:
            NotFound: no recording. BadFile: one is damaged, or none has a slice with truth. BadInput: no such split.
        """
        given = [paths] if isinstance(paths, str | Path) else paths
        self.recordings = recordings_in((Path(path) for path in given), split=split, part=part)
        self._folders = [prepare(path) for path in self.recordings]
        self._opened: dict[int, Prepared] = {}
        middles = [self._recording(number).middles() for number in range(len(self._folders))]
        self._index = np.concatenate(
            [np.stack((np.full(len(each), n), each), axis=1) for n, each in enumerate(middles)]
        )
        if not len(self._index):
            raise BadFile("no recording has a slice with truth", fix="`evimo check` says what is wrong with one")

    def __len__(self) -> int:
        return len(self._index)

    def __getitem__(self, place: int) -> SliceSample:
        number, k = self._index[place].tolist()
        recording = self._recording(number)
        depth = torch.from_numpy(recording.depth[k].astype(np.float32))[None]
        return SliceSample(
            events=_events(recording, k),
            depth=depth,
            depth_valid=depth > 0,
            ids=torch.from_numpy(np.array(recording.ids[k]))[None],
            moving=torch.from_numpy(np.array(recording.moving[k]))[None],
            flow=torch.from_numpy(recording.flow[k].astype(np.float32)),
            valid=torch.from_numpy(np.array(recording.valid))[None],
            ego=torch.from_numpy(np.array(recording.ego[k])),
            intrinsics=torch.from_numpy(np.array(recording.intrinsics)),
        )

    def __getstate__(self) -> dict[str, Any]:
        """What goes to another process: open arrays would go there as copies."""
        return {**self.__dict__, "_opened": {}}

    def _recording(self, number: int) -> Prepared:
        if number not in self._opened:
            self._opened[number] = open_prepared(self._folders[number])
        return self._opened[number]


def collated(samples: Sequence[SliceSample]) -> SliceSample:
    """Samples as one batch, for a DataLoader's `collate_fn`: maps stacked, events one after the other.

    Raises:
        BadInput: they are of cameras of different sizes.
    """
    if len({sample.depth.shape for sample in samples}) > 1:
        raise BadInput("samples of cameras of different sizes in one batch", fix="a data set for each camera")
    numbers = [torch.full((len(sample.events), 1), float(place)) for place, sample in enumerate(samples)]
    events = [torch.cat((number, sample.events), dim=1) for number, sample in zip(numbers, samples, strict=True)]
    maps = [torch.stack(column) for column in list(zip(*samples, strict=True))[1:]]
    return SliceSample(torch.cat(events), *maps)


def _events(recording: Prepared, k: int) -> Tensor:
    first, last = int(recording.event_first[k]), int(recording.event_first[k + 1])
    x, y = (recording.event_xy[first:last] / np.float32(SUBPIXEL)).astype(np.float32).T
    t = (recording.event_t[first:last].astype(np.float32) - SLICE_US / 2) * np.float32(1e-6)
    p = np.where(recording.event_on[first:last], 1, -1).astype(np.float32)
    return torch.from_numpy(np.stack((x, y, t, p), axis=1).astype(np.float32))
