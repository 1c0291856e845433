"""Write a recording with truth as one HDF5 file, slice by slice, in constant memory."""

import json
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadInput
from evimo.events.events import Events
from evimo.geometry.camera import Camera
from evimo.recordings.facts import MARK
from evimo.recordings.hdf5_file import Hdf5File
from evimo.recordings.hdf5_layout import grown
from evimo.recordings.imu import Imu
from evimo.recordings.pose_track import PoseSource
from evimo.recordings.stored import checked_ids, exact_motions, exact_poses, stored_maps, tracks, without_maps
from evimo.recordings.truth import Truth
from evimo.writing import OutputFolder

FORMAT = 1


class Hdf5Writer:
    """Writes beside the target and moves the finished file there, so that a file that exists is complete.

    Use as a context manager; an exception inside leaves nothing behind.

    Args:
        path: to make, .h5; must not exist yet.
        camera: of the sensor. poses: where it and the objects are. facts: plain numbers and words, how it was made.
        imu: what an inertial measurement unit says, if there is one.
    """

    def __init__(
        self,
        path: Path,
        camera: Camera,
        *,
        poses: PoseSource | None = None,
        facts: dict[str, Any] | None = None,
        imu: Imu | None = None,
    ) -> None:
        if path.exists():
            raise BadInput(f"{path} exists", fix="another name, or remove it")
        self.path, self.camera, self.poses, self.facts, self.imu = path, camera, poses, facts or {}, imu
        self.truths: list[Truth] = []

    def __enter__(self) -> "Hdf5Writer":
        """Begin.

        Raises:
            BadInput: it cannot be written there.
        """
        self._outputs = OutputFolder(self.path.parent, names=self.path)
        self._outputs.__enter__()
        try:
            self._file = Hdf5File(self._outputs.path(self.path.name), attributes={})
        except OSError as full:
            self._outputs.__exit__(type(full), full, full.__traceback__)
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Complete the file, or leave nothing.

        Raises:
            BadInput: the disk is full, or cannot be written any more.
        """
        try:
            if error is None:
                self._finish()
                self._file.close()
                self._outputs.keep(self.path.name)
            else:
                with suppress(OSError):  # what came first is told
                    self._file.close()
        except OSError as full:
            kind, error, trace = type(full), full, full.__traceback__
            raise
        finally:
            self._outputs.__exit__(kind, error, trace)

    def write(
        self,
        events: Events,
        truth: Truth,
        *,
        clutter_bodies: NDArray[np.uint8] | None = None,
        event_ids: NDArray[np.uint8] | None = None,
    ) -> None:
        """Append the events of one slice and the truth of one instant, see `Writer.write`."""
        columns = {"x": events.x, "y": events.y, "t": events.t, "p": (events.p > 0).astype(np.uint8)}
        if event_ids is not None:
            columns["ids"] = checked_ids(event_ids, events)
        for name, values in columns.items():
            grown(self._file.content, f"events/{name}", values)
        for name, values in stored_maps(truth, clutter_bodies).items():
            grown(self._file.content, f"truth/{name}", values[None])
        self._file.check()
        self.truths.append(without_maps(truth))

    def _finish(self) -> None:
        content, sim = self._file.content, exact_motions(self.truths)
        if self.poses:
            sim |= exact_poses(*tracks(self.poses, sim["times_us"]))
        for name, values in sim.items():
            content[f"sim/{name}"] = values
        for name, values in (self.imu.arrays() if self.imu else {}).items():
            content[f"imu/{name}"] = values
        facts = {"format": FORMAT, "camera": asdict(self.camera), **self.facts}
        content.attrs[MARK] = json.dumps(facts)
        content["events"].attrs["height"], content["events"].attrs["width"] = self.camera.size
