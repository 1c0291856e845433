"""Write a recording with truth as an EVIMO2v2 folder, slice by slice; nothing is pickled.

In memory stays only how things move: poses at 200 Hz.
"""

import json
import zipfile
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
from evimo.recordings.pose_track import PoseSource
from evimo.recordings.pose_words import frame_words, listed
from evimo.recordings.stored import (
    checked_ids,
    exact_motions,
    exact_poses,
    save_arrays,
    save_maps,
    stored_maps,
    tracks,
    without_maps,
)
from evimo.recordings.truth import Truth
from evimo.writing import new_folder

ARRAYS = {"t": ("<f8", 1), "xy": ("<u2", 2), "p": ("|u1", 1)}
IDS = "id"  # of what each event's pixel saw; where the writer is told
KINDS = ARRAYS | {IDS: ("|u1", 1)}
MAPS = ("depth", "mask", "clutter")
FORMAT = 1


class RecordingWriter:
    """Writes beside the target and moves the finished folder there, so that a folder that exists is complete.

    Use as a context manager; an exception inside leaves nothing behind.

    Args:
        folder: to make; must not exist yet.
        camera: of the sensor. facts: plain numbers and words for the JSON, how it was made.
        poses: where the camera and the objects are; without, none are written. imu: likewise.
    """

    def __init__(
        self,
        folder: Path,
        camera: Camera,
        *,
        facts: dict[str, Any] | None = None,
        poses: PoseSource | None = None,
        imu: Imu | None = None,
    ) -> None:
        if folder.exists():
            raise BadInput(f"{folder} exists", fix="another name, or remove it")
        self.folder, self.camera, self.facts = folder, camera, facts or {}
        self.poses, self.imu = poses, imu
        self.truths: list[Truth] = []
        self.events = 0

    def __enter__(self) -> "RecordingWriter":
        """Begin.

        Raises:
            BadInput: it cannot be written there.
        """
        with ExitStack() as opened:
            self._unfinished = opened.enter_context(new_folder(self.folder))
            opened.callback(self._close_all)
            self._arrays: dict[str, BinaryIO] = {}
            self._maps: dict[str, zipfile.ZipFile] = {}
            for name in ARRAYS:
                self._arrays[name] = self._begun(name)
            for name in MAPS:
                self._maps[name] = zipfile.ZipFile(self._file(f"{name}.npz"), "w", zipfile.ZIP_DEFLATED)
            opened.push(self._complete)
            self._open = opened.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Complete the folder, or leave nothing.

        Raises:
            BadInput: the disk is full, or cannot be written any more.
        """
        self._open.__exit__(kind, error, trace)

    def _complete(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Finish every file, unless there was an error."""
        if error is not None:
            return
        for name, file in self._arrays.items():
            file.seek(0)
            _write_header(file, name, self.events)
            file.close()
        for archive in self._maps.values():
            archive.close()
        self._write_facts()

    def _close_all(self) -> None:
        """Close what an error has left open; a full disk has been heard of."""
        for file in (*self._arrays.values(), *self._maps.values()):
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
            if not self.truths:
                self._arrays[IDS] = self._begun(IDS)
            self._arrays[IDS].write(checked_ids(event_ids, events).tobytes())
        self.events += len(events)
        self._arrays["t"].write((events.t * 1e-6).astype("<f8").tobytes())
        self._arrays["xy"].write(np.stack((events.x, events.y), axis=1).astype("<u2").tobytes())
        self._arrays["p"].write((events.p > 0).astype("|u1").tobytes())
        for name, values in stored_maps(truth, clutter_bodies).items():
            save_maps(self._maps[name], {f"{name}_{len(self.truths):010d}": values})
        self.truths.append(without_maps(truth))

    def _begun(self, name: str) -> BinaryIO:
        file = self._file(f"events_{name}.npy").open("wb")
        _write_header(file, name, 0)
        return file

    def _file(self, name: str) -> Path:
        return self._unfinished / f"dataset_{name}"

    def _write_facts(self) -> None:
        sim = exact_motions(self.truths)
        frames = iter([json.dumps([{"id": k, "ts": t * 1e-6} for k, t in enumerate(sim["times_us"].tolist())])])
        if self.poses:
            at_frames, trajectory = tracks(self.poses, sim["times_us"])
            sim |= exact_poses(at_frames, trajectory)
            frames = listed(at_frames.in_world_of(trajectory.world_from_cam[0]), frame_words)
        for name, arrays in (("sim", sim), ("imu", self.imu.arrays() if self.imu else {})):
            if arrays:
                with zipfile.ZipFile(self._file(f"{name}.npz"), "w") as archive:
                    save_arrays(archive, arrays)
        with self._file("info.json").open("w") as file:
            file.write(
                json.dumps({"evimo": self._facts()})[:-1] + f',\n"meta": {{"meta": {json.dumps(self._lens())},\n'
            )
            file.write('"frames": ')
            file.writelines(frames)
            file.write("}}")

    def _facts(self) -> dict[str, Any]:
        return {"format": FORMAT, "camera": asdict(self.camera), **self.facts}

    def _lens(self) -> dict[str, Any]:
        """The camera in EVIMO2's words."""
        lens = self.camera
        names = ("k1", "k2", "p1", "p2", "k3") if lens.lens == "radtan" else ("k1", "k2", "k3", "k4")
        intrinsics = {name: 0.0 for name in ("k1", "k2", "k3", "k4", "p1", "p2")}
        intrinsics |= dict(zip(names, lens.distortion, strict=False))
        meta = {"fx": lens.fx, "fy": lens.fy, "cx": lens.cx, "cy": lens.cy, **intrinsics}
        meta |= {"dist_model": "radtan" if lens.lens == "radtan" else "equidistant"}
        meta |= {"res_x": lens.width, "res_y": lens.height, "ros_time_offset": 0.0}
        return meta


def _write_header(file: BinaryIO, name: str, rows: int) -> None:
    """NumPy pads headers so that the first axis can grow in place."""
    kind, columns = KINDS[name]
    shape = (rows,) if columns == 1 else (rows, columns)
    header = {"descr": kind, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(file, header)
