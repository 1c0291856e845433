"""Write a recording with truth as one .npz in the layout of EV-IMO's first version; nothing is pickled.

Slices go to plain files beside the target, which become members of the archive at the end. In memory stays only how
things move: poses at 200 Hz. What that layout pickles, the dictionary `meta`, is text here: JSON, and a Python literal
at the same time.
"""

import json
import shutil
import zipfile
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadInput
from evimo.events.events import Events
from evimo.geometry.camera import Camera
from evimo.recordings.imu import Imu
from evimo.recordings.pose_track import PoseSource, PoseTrack
from evimo.recordings.pose_words import frame_words, in_v1_axes, listed, trajectory_words
from evimo.recordings.stored import (
    Arrays,
    checked_ids,
    exact_motions,
    exact_poses,
    member,
    save_arrays,
    stored_maps,
    tracks,
    without_maps,
)
from evimo.recordings.truth import Truth
from evimo.writing import OutputFolder

FORMAT = 1
STEP_US = 10_000  # of the table `index`
GROWING = {"events": "<f8", "depth": "<u2", "mask": "<u2", "sim_clutter": "|u1", "sim_event_ids": "|u1"}


class Evimo1Writer:
    """Writes beside the target and moves the finished file there, so that a file that exists is complete.

    Use as a context manager; an exception inside leaves nothing behind.

    Args:
        path: to make, .npz; must not exist yet.
        camera: of the sensor: a pinhole, or radtan with k1 k2 p1 p2, which is all the layout can hold.
        poses: where the camera and the objects are. facts: plain numbers and words, how it was made.
        imu: what an inertial measurement unit says, if there is one.
    """

    def __init__(
        self,
        path: Path,
        camera: Camera,
        *,
        poses: PoseSource,
        facts: dict[str, Any] | None = None,
        imu: Imu | None = None,
    ) -> None:
        if path.exists():
            raise BadInput(f"{path} exists", fix="another name, or remove it")
        if camera.lens != "radtan" or any(camera.distortion[4:]):
            raise BadInput(
                f"the EV-IMO layout cannot hold a {camera.lens} lens of {len(camera.distortion)} coefficients",
                fix="radtan with k1 k2 p1 p2, or the layout evimo2",
            )
        self.path, self.camera, self.poses, self.facts = path, camera, poses, facts or {}
        self.imu = imu
        self.truths: list[Truth] = []
        self.index = TimeIndex()
        self._labelled = False

    def __enter__(self) -> "Evimo1Writer":
        """Begin.

        Raises:
            BadInput: it cannot be written there.
        """
        with ExitStack() as opened:
            self._outputs = opened.enter_context(OutputFolder(self.path.parent, names=self.path))
            opened.callback(self._close_all)
            self._files: dict[str, BinaryIO] = {}
            for name in GROWING:
                self._files[name] = self._outputs.path(name).open("wb")
            opened.push(self._complete)
            self._open = opened.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Complete the file, or leave nothing.

        Raises:
            BadInput: the disk is full, or cannot be written any more.
        """
        self._open.__exit__(kind, error, trace)

    def _complete(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Pack everything and give it its name, unless there was an error."""
        if error is None:
            for file in self._files.values():
                file.close()
            self._pack()
            self._outputs.keep(self.path.name)

    def _close_all(self) -> None:
        """Close what an error has left open; a full disk has been heard of."""
        for file in self._files.values():
            with suppress(OSError):
                file.close()

    def write(
        self,
        events: Events,
        truth: Truth,
        *,
        clutter_bodies: NDArray[np.uint8] | None = None,
        event_ids: NDArray[np.uint8] | None = None,
    ) -> None:
        """Append the events of one slice and the truth of one instant, see `Writer.write`."""
        if event_ids is not None:
            self._labelled = True
            self._append("sim_event_ids", checked_ids(event_ids, events))
        rows = np.stack((events.t * 1e-6, events.x, events.y, events.p > 0), axis=1)
        self._append("events", rows)
        self.index.add(events.t)
        maps = stored_maps(truth, clutter_bodies)
        for name, values in (("depth", maps["depth"]), ("mask", maps["mask"]), ("sim_clutter", maps["clutter"])):
            self._append(name, values)
        self.truths.append(without_maps(truth))

    def _append(self, name: str, values: NDArray[Any]) -> None:
        self._files[name].write(np.ascontiguousarray(values, np.dtype(GROWING[name])).tobytes())

    def _pack(self) -> None:
        """Make the archive of everything, without its name yet."""
        target, maps = self._outputs.path(self.path.name), (len(self.truths), *self.camera.size)
        motions = exact_motions(self.truths)
        frames, trajectory = tracks(self.poses, motions["times_us"])
        exact = motions | exact_poses(frames, trajectory)
        exact |= {f"imu_{name}": values for name, values in self.imu.arrays().items()} if self.imu else {}
        with zipfile.ZipFile(target, "w") as archive:
            self._move_in(archive, "events", (self.index.events, 4))
            if self._labelled:
                self._move_in(archive, "sim_event_ids", (self.index.events,))
            save_arrays(archive, self._small_arrays())
            for name in ("depth", "mask", "sim_clutter"):
                self._move_in(archive, name, maps)
            characters = self._write_text("meta", self._meta(frames, trajectory))
            self._move_in(archive, "meta", (), kind=f"<U{characters}")
            save_arrays(archive, {f"sim_{name}": values for name, values in exact.items()})

    def _write_text(self, name: str, pieces: Iterator[str]) -> int:
        """A file beside the target as NumPy stores text, four bytes a character; how many characters."""
        characters = 0
        with self._outputs.path(name).open("wb") as file:
            for piece in pieces:
                characters += len(piece)
                file.write(piece.encode("utf-32-le"))
        return characters

    def _move_in(self, archive: zipfile.ZipFile, name: str, shape: tuple[int, ...], *, kind: str | None = None) -> None:
        """A file beside the target as an array of the archive."""
        path, info = self._outputs.path(name), member(name)
        info.file_size = path.stat().st_size  # tells whether the member needs 64-bit sizes
        header = {"descr": kind or GROWING[name], "fortran_order": False, "shape": shape}
        with path.open("rb") as source, archive.open(info, "w") as target:
            np.lib.format.write_array_header_1_0(target, header)
            shutil.copyfileobj(source, target, 1 << 20)
        path.unlink()

    def _small_arrays(self) -> Arrays:
        lens = self.camera
        intrinsics = np.array([[lens.fx, 0, lens.cx], [0, lens.fy, lens.cy], [0, 0, 1]])
        facts = {"format": FORMAT, "camera": asdict(lens), **self.facts}
        return {
            "index": self.index.table(),
            "discretization": np.array(STEP_US * 1e-6),
            "K": intrinsics,
            "D": np.array(_coefficients(lens)),
            "sim_facts": np.array(json.dumps(facts)),
        }

    def _meta(self, frames: PoseTrack, trajectory: PoseTrack) -> Iterator[str]:
        """The dictionary `meta` as text: v1 axes, and `res_x` the *height*, as the dataset has it."""
        lens, start = self.camera, trajectory.world_from_cam[0]
        numbers = {"fx": lens.fx, "fy": lens.fy, "cx": lens.cx, "cy": lens.cy}
        numbers |= dict(zip(("k1", "k2", "k3", "k4"), _coefficients(lens), strict=True))
        numbers |= {"res_x": lens.height, "res_y": lens.width}
        yield f'{{"meta": {json.dumps(numbers)}, "frames": '
        yield from listed(frames.in_world_of(start), frame_words, axes=in_v1_axes)
        yield ', "full_trajectory": '
        yield from listed(trajectory.in_world_of(start), trajectory_words, axes=in_v1_axes)
        yield "}"


class TimeIndex:
    """The table `index`: the first event at or after every 10 ms from the first event on, and the last event."""

    def __init__(self) -> None:
        self.events = 0
        self._next_us: int | None = None
        self._entries: list[int] = []

    def add(self, t: NDArray[np.int64]) -> None:
        """Times (N,) of the events that follow, µs."""
        if len(t):
            start = int(t[0]) if self._next_us is None else self._next_us
            grid = np.arange(start, int(t[-1]) + 1, STEP_US)
            self._entries += (self.events + np.searchsorted(t, grid)).tolist()
            self._next_us = start + STEP_US * len(grid)
            self.events += len(t)

    def table(self) -> NDArray[np.uint32]:
        """(M,), the last entry is the last event's."""
        last = [self.events - 1] if self.events else []
        return np.array(self._entries + last, np.uint32)


def _coefficients(lens: Camera) -> tuple[float, float, float, float]:
    """The four coefficients of the layout: k1 k2 p1 p2, under the names k1 to k4."""
    k1, k2, p1, p2 = (*lens.distortion, 0.0, 0.0, 0.0, 0.0)[:4]
    return k1, k2, p1, p2
