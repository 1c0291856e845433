"""Depth maps and masks as EV-IMO and EVIMO2 store them, one frame at a time, in sensor pixels."""

from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile
from evimo.formats.array_rows import Rows
from evimo.formats.evimo_meta import MetaPoses
from evimo.formats.npz_members import Archive
from evimo.formats.pictures import read_picture

COPY = "copy the whole recording again from the dataset"
ID_STEP = 1000  # of masks: an object's number times this


class Maps(Protocol):
    """Where the maps of a recording's frames lie.

    size: (height, width).
    """

    size: tuple[int, int]

    def has(self, frame: int) -> bool:
        """Whether there are maps of a frame of `meta`."""
        ...

    def read(self, name: str, frame: int) -> NDArray[Any]:
        """`depth` or `mask` (H, W) of a frame, as stored."""
        ...


class ArchivedMaps:
    """Arrays `depth` and `mask` (F, H, W) of an .npz file, in the order of `meta`'s frames."""

    def __init__(self, archive: Archive) -> None:
        """Look at the headers.

        Raises:
            BadFile: an array is missing or has another shape, or the two do not fit together.
        """
        self._rows = {name: Rows(archive, name, dimensions=3, kinds="iuf", fix=COPY) for name in ("depth", "mask")}
        depth, mask = (self._rows[name].header.shape for name in ("depth", "mask"))
        if depth != mask:
            raise BadFile(f"{archive.path}: `depth` is {depth}, `mask` is {mask}", fix=COPY)
        self.size: tuple[int, int] = depth[1], depth[2]

    def __len__(self) -> int:
        return len(self._rows["depth"])

    def has(self, frame: int) -> bool:
        """Whether the arrays reach to that frame."""
        return frame < len(self)

    def read(self, name: str, frame: int) -> NDArray[Any]:
        """One row."""
        return self._rows[name].read(frame, frame + 1)[0]


class FolderMaps:
    """Members `depth_0000000012` and so on of dataset_depth.npz and dataset_mask.npz, by their own numbers."""

    def __init__(self, folder: Path, frames: MetaPoses) -> None:
        """Open both archives.

        Raises:
            BadFile: one is missing, or holds no maps.
        """
        self._archives: dict[str, Archive] = {}
        for name in ("depth", "mask"):
            path = folder / f"dataset_{name}.npz"
            if not path.exists():
                raise BadFile(f"{folder} lacks {path.name}", fix=COPY)
            self._archives[name] = Archive(path)
        # Numbers count frames of the whole film, those without truth too: an entry's id less the first one's.
        self._numbers = frames.ids - frames.ids[0] if len(frames) else frames.ids
        first = min(self._archives["depth"].names)
        shape = self._archives["depth"].header(first).shape
        if len(shape) != 2:
            raise BadFile(f"`{first}` in {folder / 'dataset_depth.npz'} is no map, but an array {shape}", fix=COPY)
        self.size: tuple[int, int] = shape

    def has(self, frame: int) -> bool:
        """Whether both archives hold that frame."""
        return all(self._member(name, frame) in archive.names for name, archive in self._archives.items())

    def read(self, name: str, frame: int) -> NDArray[Any]:
        """One member."""
        values = self._archives[name].whole(self._member(name, frame))
        if values.shape != self.size or values.dtype.kind not in "iuf":
            text = f"`{self._member(name, frame)}` of {self._archives[name].path} is {values.dtype} {values.shape}"
            raise BadFile(f"{text}, no map of {self.size}", fix=COPY)
        return values

    def _member(self, name: str, frame: int) -> str:
        return f"{name}_{int(self._numbers[frame]):010d}"


class PictureMaps:
    """Pictures img/depth_mask_12.png of 16 bits: depth in blue and green, masks in red."""

    def __init__(self, folder: Path, frames: MetaPoses) -> None:
        """Look at the first one.

        Raises:
            BadFile: there is none, or it is of another kind.
        """
        self._folder, self._pictures = folder / "img", frames.pictures
        self._newest: tuple[int, NDArray[Any]] | None = None
        first = next((k for k in range(len(frames)) if self.has(k)), None)
        if first is None:
            raise BadFile(f"{folder} has no picture of truth that meta.txt names, img/depth_mask_….png", fix=COPY)
        self.size: tuple[int, int] = self._picture(first).shape[:2]  # type: ignore[assignment]

    def has(self, frame: int) -> bool:
        """Whether the frame's picture is there."""
        name = self._pictures[frame]
        return bool(name) and Path(name).name == name and (self._folder / name).is_file()

    def read(self, name: str, frame: int) -> NDArray[Any]:
        """One channel."""
        return self._picture(frame)[:, :, 0 if name == "depth" else 2]

    def _picture(self, frame: int) -> NDArray[Any]:
        if self._newest is None or self._newest[0] != frame:
            path = self._folder / self._pictures[frame]
            picture = read_picture(path)
            if picture is None or picture.ndim != 3 or picture.shape[2] != 3 or picture.dtype != np.uint16:
                raise BadFile(f"{path} is no picture of three channels of 16 bits", fix=COPY)
            self._newest = frame, picture
        return self._newest[1]


class NoMaps:
    """What a bag has, which holds poses only: nothing is known of any pixel."""

    def __init__(self, size: tuple[int, int]) -> None:
        self.size = size

    def has(self, frame: int) -> bool:
        """Of every frame that nothing is known."""
        return frame >= 0

    def read(self, name: str, frame: int) -> NDArray[Any]:
        """Zeros."""
        return np.zeros(self.size, np.uint16)


def in_mm(depth: NDArray[Any]) -> NDArray[np.float32]:
    """Depth (H, W) in mm; 0 where it is not known, which files say with 0 or NaN."""
    whole = np.nan_to_num(depth.astype(np.float32), nan=0, posinf=0, neginf=0)
    return np.maximum(whole, np.float32(0))


def as_mask(mask: NDArray[Any]) -> NDArray[np.uint16]:
    """A mask (H, W) of whole numbers, 1000 for each id: those of floats are rounded before they are divided."""
    ids = np.rint(np.nan_to_num(mask.astype(np.float64)) / ID_STEP)
    return (np.where((ids >= 0) & (ids <= 60), ids, 0) * ID_STEP).astype(np.uint16)
