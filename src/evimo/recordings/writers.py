"""The layouts in which recordings with truth are written, and what the writers of all of them have in common."""

from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadInput
from evimo.events.events import Events
from evimo.geometry.camera import Camera
from evimo.recordings.evimo1_writer import Evimo1Writer
from evimo.recordings.hdf5_writer import Hdf5Writer
from evimo.recordings.imu import Imu
from evimo.recordings.pose_track import PoseSource
from evimo.recordings.truth import Truth
from evimo.recordings.writer import RecordingWriter

Target = Literal["evimo1", "evimo2", "hdf5"]
SUFFIXES: dict[str, str] = {"evimo1": ".npz", "evimo2": "", "hdf5": ".h5"}
DATASET_LAYOUTS = ("evimo2", "evimo1")
"""Those of EV-IMO, in which recordings are made; HDF5 is what they are converted to."""


class Writer(Protocol):
    """Writes a recording slice by slice, as a context manager; what it makes appears only when it is complete."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...

    def write(
        self,
        events: Events,
        truth: Truth,
        *,
        clutter_bodies: NDArray[np.uint8] | None = None,
        event_ids: NDArray[np.uint8] | None = None,
    ) -> None:
        """Append the events of one slice and the truth of one instant.

        clutter_bodies: (H, W), numbers them. event_ids: (N,) of what each event's pixel saw; with every slice or none.
        """
        ...


def check_dataset_layout(layout: str) -> None:
    """Make sure that recordings are made in a layout.

    Raises:
        BadInput: they are not.
    """
    if layout not in DATASET_LAYOUTS:
        raise BadInput(f"no layout {layout!r}", fix=f"one of {', '.join(DATASET_LAYOUTS)}")


def writer_of(
    layout: str,
    path: Path,
    camera: Camera,
    *,
    poses: PoseSource | None = None,
    facts: dict[str, Any] | None = None,
    imu: Imu | None = None,
) -> Writer:
    """The writer of a layout.

    Args:
        layout: one of `SUFFIXES`.
        path: to make, with the layout's suffix; must not exist yet.
        camera: of the sensor.
        poses: where it and the objects are. facts: plain numbers and words, how it was made. imu: what it says.

    Raises:
        BadInput: the path exists, or the layout cannot hold the lens, or needs poses.
    """
    if layout == "evimo1":
        if poses is None:
            raise BadInput(f"no poses for {path}, which the layout evimo1 needs", fix="evimo2 or hdf5")
        return Evimo1Writer(path, camera, poses=poses, facts=facts, imu=imu)
    writer = Hdf5Writer if layout == "hdf5" else RecordingWriter
    return writer(path, camera, poses=poses, facts=facts, imu=imu)
