"""Recordings with truth brought into the rectified image, once, as memory-mapped arrays that training reads."""

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile
from evimo.events.slices import SLICE_US, Slice, in_slices
from evimo.geometry.camera import Camera
from evimo.geometry.rectification import Rectification, rectified
from evimo.recordings.flow import true_flow
from evimo.recordings.recording import PREPARED, Recording, open_recording
from evimo.recordings.truth import Truth
from evimo.writing import new_folder, remove_leftovers

FORMAT = 1
ROOM = "more room, or a copy of the recordings on a disk that can be written: each is prepared once, in its folder"
SUBPIXEL = 64  # steps per px of stored event positions
NAMES = ("valid", "depth", "ids", "moving", "clutter", "flow", "velocity", "ego")
EVENT_NAMES = ("event_xy", "event_t", "event_on", "event_first")


@dataclass(frozen=True, slots=True)
class Prepared:
    """One recording's slices that have truth, in the rectified image (h, w); arrays are memory-mapped.

    intrinsics: (4,) fx fy cx cy, px.
    valid:    (h, w) bool, pixels that the lens sees.
    depth:    (S, h, w) float16, m; 0 is unknown.
    ids:      (S, h, w) uint8.
    moving:   (S, h, w) bool, pixels of objects that move at that instant.
    clutter:  (S, h, w) bool.
    flow:     (S, 2, h, w) float16, 1/s on the plane Z = 1.
    velocity: (S, 256, 3) float32, of each id, camera axes, m/s; 0 of what rests.
    ego:      (S, 6) float32.
    event_xy: (N, 2) uint16, column and row of each event of these slices in 1/64 px; event_t: (N,) uint16, µs since the
        slice's start; event_on: (N,) bool, brighter; event_first: (S + 1,) int64, first event of each slice.
    known: (S,) bool, slices whose truth is known, None where all are; of the others only the events mean anything.
    """

    intrinsics: NDArray[np.float32]
    valid: NDArray[np.bool_]
    depth: NDArray[np.float16]
    ids: NDArray[np.uint8]
    moving: NDArray[np.bool_]
    clutter: NDArray[np.bool_]
    flow: NDArray[np.float16]
    velocity: NDArray[np.float32]
    ego: NDArray[np.float32]
    event_xy: NDArray[np.uint16]
    event_t: NDArray[np.uint16]
    event_on: NDArray[np.bool_]
    event_first: NDArray[np.int64]
    known: NDArray[np.bool_] | None = None

    def middles(self) -> NDArray[np.int64]:
        """The slices that can be the middle of a sample: those whose truth is known."""
        return np.arange(len(self)) if self.known is None else np.flatnonzero(self.known)

    def __len__(self) -> int:
        return len(self.ego)


def prepare(path: Path) -> Path:
    """Write the arrays of `Prepared` into the recording's own folder, or beside its file, if they are not there yet.

    Returns where.

    Raises:
        BadFile: the recording is damaged, or has no truth. BadInput: its folder cannot be written, or the disk is full.
    """
    name = f"{PREPARED}{FORMAT}"
    target = path / name if path.is_dir() else path.with_name(f"{path.name}.{name}")
    remove_leftovers(target.parent)
    if target.exists():
        return target
    recording = open_recording(path)
    if not len(recording):
        raise BadFile(f"{path} has no slice with truth", fix="simulate at least 0.025 s")
    with new_folder(target, fix=ROOM) as unfinished:
        arrays, intrinsics = _arrays(recording.camera, _stored_slices(recording))
        for name, values in arrays.items():
            _save_array(values, unfinished / f"{name}.npy")
        (unfinished / "camera.json").write_text(json.dumps({"intrinsics": intrinsics}))
    return target


def _save_array(values: NDArray[Any], path: Path) -> None:
    """As `np.save`, whose error does not say that the disk is full."""
    with path.open("wb") as file:
        np.lib.format.write_array_header_1_0(file, np.lib.format.header_data_from_array_1_0(values))
        file.write(np.ascontiguousarray(values).data)


def open_prepared(folder: Path) -> Prepared:
    """Open what `prepare` wrote; files of arrays that are no longer read, which earlier versions wrote, do no harm.

    Raises:
        BadFile: it is damaged.
    """
    try:
        intrinsics = np.array(json.loads((folder / "camera.json").read_text())["intrinsics"], np.float32)
        arrays = {
            name: np.load(folder / f"{name}.npy", mmap_mode="r", allow_pickle=False)
            for name in (*NAMES, *EVENT_NAMES, *(("known",) if (folder / "known.npy").exists() else ()))
        }
    except (OSError, EOFError, ValueError, KeyError, TypeError) as error:
        raise BadFile(f"{folder} is damaged: {error}", fix="delete it; it is made again") from error
    return Prepared(intrinsics, **arrays)


def prepared_in_memory(camera: Camera, slices: Iterable[tuple[Slice, Truth | None]]) -> Prepared:
    """The slices of a recording that no file holds, one at least, in the rectified image of its camera."""
    arrays, intrinsics = _arrays(camera, slices)
    return Prepared(np.array(intrinsics, np.float32), **arrays)


def _stored_slices(recording: Recording) -> Iterator[tuple[Slice, Truth | None]]:
    """Every slice from the first instant of truth to the last, and its truth where that is known."""
    first_us = int(recording.times_us[0]) // SLICE_US * SLICE_US
    stop_us = int(recording.times_us[-1]) + SLICE_US // 2
    for part in in_slices(recording.events.packets(first_us), SLICE_US, start_us=first_us, stop_us=stop_us):
        if part.start_us >= stop_us:
            break
        yield part, recording.truth_at(part.centre_us)


def _arrays(
    camera: Camera, slices: Iterable[tuple[Slice, Truth | None]]
) -> tuple[dict[str, NDArray[Any]], list[float]]:
    """Everything of one recording, by name, and its rectified intrinsics."""
    rectification = rectified(camera)
    pixels, _ = camera.normalised(camera.pixels())
    grid = np.moveaxis(pixels, -1, 0)
    rows = [
        _truth_row(truth or _unknown(camera, part), grid, rectification)
        | {"known": np.array(truth is not None)}
        | _event_row(part, rectification)
        for part, truth in slices
    ]
    arrays = {name: np.stack([row[name] for row in rows]) for name in (*NAMES, "known") if name != "valid"}
    arrays |= {name: np.concatenate([row[name] for row in rows]) for name in EVENT_NAMES[:3]}
    if arrays["known"].all():
        del arrays["known"]
    counts = [len(row["event_t"]) for row in rows]
    arrays |= {"event_first": np.cumsum([0, *counts]), "valid": rectification.image_valid}
    image = rectification.image
    return arrays, [image.fx, image.fy, image.cx, image.cy]


def _unknown(camera: Camera, part: Slice) -> Truth:
    """What stands for the truth of a slice of which none is known, so that the slices beside it stay beside it."""
    nothing = np.zeros(camera.size)
    masks = nothing.astype(np.bool_), nothing.astype(np.uint8), nothing.astype(np.bool_)
    return Truth(part.centre_us, nothing.astype(np.float32), *masks, np.zeros(6), {})


def _truth_row(truth: Truth, grid: NDArray[np.float64], rectification: Rectification) -> dict[str, NDArray[Any]]:
    """One slice's truth in the rectified image."""
    velocity = np.zeros((256, 3), np.float32)
    for number in truth.movers:
        velocity[number] = truth.objects[number].velocity
    flow = np.clip(true_flow(truth, grid), -1e4, 1e4)
    return {
        "depth": rectification.from_sensor(np.where(truth.valid, truth.depth, 0)).astype(np.float16),
        "ids": rectification.from_sensor(truth.ids),
        "moving": rectification.from_sensor(truth.of_movers(truth.ids)),
        "clutter": rectification.from_sensor(truth.clutter),
        "flow": rectification.from_sensor(flow).astype(np.float16),
        "velocity": velocity,
        "ego": truth.ego.astype(np.float32),
    }


def _event_row(slice_: Slice, rectification: Rectification) -> dict[str, NDArray[Any]]:
    """One slice's events in the rectified image."""
    events = slice_.events
    kept = rectification.valid[events.y, events.x]
    x, y = events.x[kept], events.y[kept]
    height, width = rectification.image.size
    at = np.stack((rectification.x[y, x].clip(0, width - 1), rectification.y[y, x].clip(0, height - 1)), axis=1)
    return {
        "event_xy": np.round(at * SUBPIXEL).astype(np.uint16),
        "event_t": (events.t[kept] - slice_.start_us).astype(np.uint16),
        "event_on": events.p[kept] > 0,
    }
