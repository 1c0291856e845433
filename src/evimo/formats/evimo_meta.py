"""The dictionary `meta` of EV-IMO and EVIMO2 as arrays: intrinsics, frames of truth and the trajectory, checked.

It comes as a pickle inside an .npz file, as the Python literal meta.txt, or as the JSON that this package writes. No
pickle is unpickled, and nothing is evaluated.
"""

import ast
import json
import re
import reprlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile
from evimo.geometry.rotations import matrices_of_angles, matrices_of_quaternions, poses_of

F8 = NDArray[np.float64]
COPY = "copy it again from the dataset"
IDS = {*range(256), *map(str, range(256))}
LARGEST = 1e300  # whole numbers may be larger than any float
NUMBERS = {"t": "xyz", "q": "wxyz", "rpy": "rpy"}


@dataclass(frozen=True, slots=True)
class MetaPoses:
    """The entries of one list of poses, in the file's axes.

    ids:             (N,) int64, what an entry calls itself. times_us: (N,) int64.
    world_from_cam:  (N, 4, 4), NaN where an entry has none.
    cam_from_object: id to (N, 4, 4), NaN likewise.
    pictures:        N names of pictures of truth; empty where an entry has none.
    without_cam:     (N,) bool, entries that do not name the camera at all.
    broken:          (N,) bool, entries with a pose, of anything, that is no rigid motion: NaN or no rotation.
    """

    ids: NDArray[np.int64]
    times_us: NDArray[np.int64]
    world_from_cam: F8
    cam_from_object: dict[int, F8]
    pictures: tuple[str, ...]
    without_cam: NDArray[np.bool_]
    broken: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.ids)


@dataclass(frozen=True, slots=True)
class Meta:
    """What `meta` holds: the camera in the dataset's words, the frames of truth, and the poses at the mocap's rate."""

    camera: dict[str, Any]
    frames: MetaPoses
    trajectory: MetaPoses


def meta_of(value: Any, where: str) -> Meta:
    """Check a dictionary `meta`, or its text, and bring it into arrays.

    Args:
        value: the dictionary or the text. where: it is, for errors.

    Raises:
        BadFile: a key is missing, or what it holds is of another kind; frames go back in time.
    """
    if isinstance(value, str):
        value = literal(value, where)
    if not isinstance(value, dict):
        raise BadFile(f"{where} is no dictionary", fix=COPY)
    if not isinstance(camera := _held(value, "meta", where), dict):
        raise BadFile(f"{where}['meta'] is no dictionary", fix=COPY)
    frames = _poses(_held(value, "frames", where), f"{where}['frames']")
    back = np.flatnonzero(np.diff(frames.times_us) < 0)
    if len(back):
        k, times = int(back[0]), frames.times_us
        text = f"goes back in time, from {times[k] * 1e-6:.6f} s to {times[k + 1] * 1e-6:.6f} s"
        raise BadFile(f"{where}['frames'][{k + 1}] {text}", fix="sort frames, depth and masks by time")
    trajectory = _poses(value.get("full_trajectory") or [], f"{where}['full_trajectory']")
    if trajectory.without_cam.any():  # an entry is a sample of the camera
        raise BadFile(f"{where}['full_trajectory'][{int(trajectory.without_cam.argmax())}] lacks 'cam'", fix=COPY)
    return Meta({str(key): number for key, number in camera.items()}, frames, trajectory)


def meta_of_text_file(path: Path) -> Meta:
    """The `meta` in a file meta.txt.

    Raises:
        BadFile: it is no literal of plain values, or lacks something; the message names the line.
    """
    try:
        text = path.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise BadFile(f"{path} cannot be read: {error}", fix=COPY) from error
    return meta_of(text, str(path))


def literal(text: str, where: str) -> Any:
    """The value of a Python literal of plain values, which is parsed as JSON where it can be.

    A parsed JSON takes a hundredth of the memory of Python's own syntax tree. Both know no names or calls.

    Raises:
        BadFile: it is something else; the message names the line.
    """
    try:
        return json.loads(_as_json(text))
    except (ValueError, RecursionError):
        pass
    try:
        return ast.literal_eval(text.strip())
    except (ValueError, TypeError, SyntaxError, MemoryError, RecursionError) as error:
        told = re.search(r"on line (\d+)", str(error))
        line = told[1] if told else getattr(error, "lineno", None)
        place = f", line {line}" if line else ""
        raise BadFile(f"{where}{place} is no literal of numbers, words, lists and dictionaries", fix=COPY) from error


def _as_json(text: str) -> str:
    """The same where words hold no quotes of their own: other quotes, numbers that are none, no last comma."""
    text = re.sub(r"(?<=[\s:\[,])(-?)(nan|inf)\b", lambda m: m[1] * (m[2] == "inf") + SPELT[m[2]], text.strip())
    return re.sub(r",(\s*[}\]])", r"\1", text.replace("'", '"'))


SPELT = {"nan": "NaN", "inf": "Infinity"}


def _held(holder: dict[Any, Any], key: str, where: str) -> Any:
    if key not in holder:
        raise BadFile(f"{where} lacks '{key}', and holds {', '.join(map(str, holder))[:80] or 'nothing'}", fix=COPY)
    return holder[key]


def _poses(entries: Any, where: str) -> MetaPoses:
    """One list of poses as arrays."""
    if not isinstance(entries, Sequence) or isinstance(entries, str):
        raise BadFile(f"{where} is no list", fix=COPY)
    for k, entry in enumerate(entries):
        if not isinstance(entry, dict):
            raise BadFile(f"{where}[{k}] is no dictionary", fix=COPY)
    times = np.array([_number(entry, "ts", f"{where}[{k}]") for k, entry in enumerate(entries)], np.float64)
    if not np.isfinite(times).all() or (np.abs(times) > 1e9).any():
        raise BadFile(f"{where}[{int(np.argmin(np.isfinite(times)))}]['ts'] is no time in seconds", fix=COPY)
    names = sorted({key for entry in entries for key in entry if key in IDS}, key=int)
    poses = {name: _matrices([entry.get(name) for entry in entries], where, name) for name in ("cam", *names)}
    absent = {name: np.array([entry.get(name) is None for entry in entries], np.bool_) for name in poses}
    unknown = {name: ~np.isfinite(found).all(axis=(1, 2)) & ~absent[name] for name, found in poses.items()}
    ids = [entry.get("id", k) for k, entry in enumerate(entries)]
    return MetaPoses(
        ids=np.array([each if isinstance(each, int) and abs(each) < 2**62 else -1 for each in ids], np.int64),
        times_us=np.rint(times * 1e6).astype(np.int64),
        world_from_cam=poses["cam"],
        cam_from_object={int(name): poses[name] for name in names},
        pictures=tuple(str(entry.get("gt_frame", "")) for entry in entries),
        without_cam=absent["cam"],
        broken=np.logical_or.reduce(list(unknown.values())),
    )


def _matrices(entries: list[Any], where: str, name: str) -> F8:
    """Each entry's pose as a matrix (N, 4, 4); NaN where there is none."""
    translations, rotations = np.full((len(entries), 3), np.nan), np.full((len(entries), 4), np.nan)
    angles = np.full((len(entries), 3), np.nan)
    for k, entry in enumerate(entries):
        if entry is None:
            continue
        place = f"{where}[{k}]['{name}']"
        if not isinstance(entry, dict) or not isinstance(pose := entry.get("pos"), dict):
            raise BadFile(f"{place} lacks 'pos'", fix=COPY)
        translations[k] = _numbers(pose, "t", f"{place}['pos']")
        if "q" in pose:
            rotations[k] = _numbers(pose, "q", f"{place}['pos']")
        else:
            angles[k] = _numbers(pose, "rpy", f"{place}['pos']")
    turned = np.isfinite(angles).all(axis=1)
    matrices = matrices_of_quaternions(rotations)
    matrices[turned] = matrices_of_angles(angles[turned])
    poses = poses_of(translations, matrices)
    poses[~np.isfinite(poses).all(axis=(1, 2))] = np.nan
    return poses


def _numbers(pose: dict[str, Any], key: str, where: str) -> list[float]:
    parts = _held(pose, key, where)
    if not isinstance(parts, dict):
        raise BadFile(f"{where}['{key}'] is no dictionary", fix=COPY)
    return [_number(parts, letter, f"{where}['{key}']") for letter in NUMBERS[key]]


def _number(holder: dict[Any, Any], key: str, where: str) -> float:
    value = _held(holder, key, where)
    if (
        isinstance(value, bool)
        or not isinstance(value, int | float)
        or (value not in (np.inf, -np.inf) and abs(value) > LARGEST)
    ):
        raise BadFile(f"{where}['{key}'] is {reprlib.repr(value)[:40]}, no number", fix=COPY)
    return float(value)
