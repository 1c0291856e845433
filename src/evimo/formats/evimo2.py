"""EVIMO2 v2 folders, and the recordings of our own simulator: memory-mapped arrays of seconds, pixels, polarities."""

import json
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile, EvimoWarning
from evimo.events.events import Events
from evimo.formats.columns import check_lengths, check_pixels, check_polarities, signs
from evimo.formats.event_file import EventFile, FoundCamera, camera_of_matrix, found_camera
from evimo.formats.npz_members import Archive, ArrayHeader, array_header
from evimo.formats.sensors import assumed_sensor, extent_of, on_sign, whole_pixels
from evimo.formats.stored_gyroscope import folder_gyroscope
from evimo.formats.stored_times import StoredTimes
from evimo.formats.survey import no_events_in
from evimo.formats.time_units import NAMES, REPEAT_EVENTS, TimeUnit, repeat_of
from evimo.geometry.camera import Camera

INFO = "dataset_info.json"
PACKET_EVENTS = 1 << 17


def open_evimo2(path: Path, sensor: tuple[int, int] | None = None, *, time_unit: TimeUnit | None = None) -> EventFile:
    """Open the folder of one recording (or any dataset_ file in it); nothing is unpickled.

    The sensor's size is that of dataset_info.json if there is one, else of the first depth or mask map. Times are in
    seconds in this layout; others that were written so are told by what a camera can do.

    Raises:
        BadFile: an array is missing, damaged, of objects, or empty.
    """
    folder = path if path.is_dir() else path.parent
    arrays = _arrays(folder)
    t, xy = arrays["t"], arrays["xy"]
    check_polarities(folder, arrays["p"][:REPEAT_EVENTS])
    check_pixels(folder, xy[:REPEAT_EVENTS, 0], xy[:REPEAT_EVENTS, 1])
    size = sensor or _stored_size(folder)
    if size is None:
        size = assumed_sensor(folder, (extent_of(whole_pixels(xy[:, 1])), extent_of(whole_pixels(xy[:, 0]))))
    times = StoredTimes(
        folder,
        lambda first, last: t[first:last],
        count=len(t),
        pixels=size[0] * size[1],
        repeat=repeat_of(xy[:REPEAT_EVENTS, 0], xy[:REPEAT_EVENTS, 1], t[:REPEAT_EVENTS]),
        said=time_unit,
    )

    on = on_sign(folder)

    def read(start_us: int) -> Iterator[Events]:
        return (_part(arrays, times, at, on) for at in range(times.place(start_us), len(t), PACKET_EVENTS))

    return EventFile(
        path=folder,
        format=f"EVIMO2 folder (times in {t.dtype} {NAMES[times.unit]})",
        sensor=size,
        start_us=times.start_us,
        stop_us=times.stop_us,
        read=read,
        camera=_camera(folder, size),
        read_gyroscope=lambda: folder_gyroscope(folder),
        contents=_contents(folder),
    )


def _part(arrays: dict[str, NDArray[Any]], times: StoredTimes, first: int, on: int) -> Events:
    part = slice(first, first + PACKET_EVENTS)
    xy = arrays["xy"][part]
    p = np.int8(on) * signs(arrays["p"][part])
    return Events(whole_pixels(xy[:, 0]), whole_pixels(xy[:, 1]), times.in_us(arrays["t"][part]), p)


def _arrays(folder: Path) -> dict[str, NDArray[Any]]:
    """The three arrays as maps of the files; where a file is cut short, all are cut to it.

    Raises:
        BadFile: they are no such arrays, or were not written together, so that nobody knows which rows belong together.
    """
    arrays = {name: mapped(folder / f"dataset_events_{name}.npy") for name in ("t", "xy", "p")}
    shapes = [array.shape[1:] for array in arrays.values()]
    if any(array.dtype.kind not in "iufb" for array in arrays.values()) or shapes != [(), (2,), ()]:
        kinds = ", ".join(f"{name} {array.dtype} {array.shape}" for name, array in arrays.items())
        raise BadFile(f"{folder}: unexpected arrays ({kinds})", fix="t (N,) seconds, xy (N, 2), p (N,)")
    stated = {f"dataset_events_{name}.npy": _header(folder / f"dataset_events_{name}.npy").shape[0] for name in arrays}
    check_lengths(folder, stated)
    shortest = min(len(array) for array in arrays.values())
    if not shortest:
        raise no_events_in(folder)
    if shortest < (count := max(stated.values())):
        text = f"{folder.name} is cut short: the first {shortest:,} events are used, of {count:,}"
        warnings.warn(text, EvimoWarning, stacklevel=4)
    return {name: array[:shortest] for name, array in arrays.items()}


def _header(path: Path) -> ArrayHeader:
    if not path.exists():
        raise BadFile(f"{path.parent} lacks {path.name}", fix="copy the whole folder of the recording")
    with path.open("rb") as file:
        return array_header(file, path.name)


def mapped(path: Path) -> NDArray[Any]:
    """The rows of an array file that are really there, mapped; nothing is unpickled.

    Raises:
        BadFile: no such file, or no array of numbers.
    """
    header = _header(path)
    columns = header.shape[1:]
    if not header.shape or 0 in columns:
        raise BadFile(f"{path.name} is of shape {header.shape}", fix="copy the recording again")
    row_bytes = header.dtype.itemsize * int(np.prod(columns))
    rows = min(header.shape[0], (path.stat().st_size - header.offset) // row_bytes)
    if not rows:
        return np.empty((0, *columns), header.dtype)
    order = "F" if header.fortran_order and columns else "C"
    if order == "F" and rows < header.shape[0]:
        raise BadFile(f"{path.name} is cut short", fix="copy the recording again")
    return np.memmap(path, header.dtype, "r", header.offset, (rows, *columns), order)


def _stored_size(folder: Path) -> tuple[int, int] | None:
    meta = _meta(folder)
    if "res_x" in meta:
        try:
            size = int(meta["res_y"]), int(meta["res_x"])
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise BadFile(f"{folder / INFO} holds no res_x and res_y", fix="whole numbers of px") from error
        if min(size) < 1:
            raise BadFile(f"{folder / INFO} says {size[1]}x{size[0]} px", fix="positive numbers")
        return size
    for name in ("depth", "mask"):
        path = folder / f"dataset_{name}.npz"
        if path.exists() and (maps := sorted(Archive(path).names)):
            return Archive(path).header(maps[0]).shape[-2:]  # type: ignore[return-value]
    return None


def _meta(folder: Path) -> dict[str, Any]:
    """The camera part of dataset_info.json, which replaces EVIMO2's pickled one; empty where there is none."""
    path = folder / INFO
    if not path.exists():
        return {}
    try:
        stored = json.loads(path.read_text())
        meta = stored.get("meta", stored)
        return meta.get("meta", meta)
    except (ValueError, AttributeError) as error:
        raise BadFile(f"{path} is no JSON object", fix="write the recording again") from error


def _camera(folder: Path, size: tuple[int, int]) -> FoundCamera | None:
    meta = _meta(folder)
    if {"fx", "fy", "cx", "cy"} <= meta.keys():
        return found_camera(lambda: _camera_of_meta(meta, size), "dataset_info.json")
    path = folder / "dataset_info.npz"
    if path.exists() and "K" in (archive := Archive(path)).names:
        matrix = archive.small("K")
        return found_camera(lambda: camera_of_matrix(matrix, size), "K in dataset_info.npz")
    return None


def _camera_of_meta(meta: dict[str, Any], size: tuple[int, int]) -> Camera:
    fisheye = meta.get("dist_model") == "equidistant"
    names = ("k1", "k2", "k3", "k4") if fisheye else ("k1", "k2", "p1", "p2", "k3")
    return Camera(
        **{name: float(meta[name]) for name in ("fx", "fy", "cx", "cy")},
        height=size[0],
        width=size[1],
        distortion=tuple(float(meta.get(name, 0.0)) for name in names),
        lens="fisheye" if fisheye else "radtan",
    )


def _contents(folder: Path) -> dict[str, str]:
    contents: dict[str, str] = {}
    for name, words in (("depth", "depth maps"), ("mask", "masks"), ("classical", "frames"), ("flow", "flow maps")):
        path = folder / f"dataset_{name}.npz"
        if path.exists() and (count := sum(member.startswith(name) for member in Archive(path).names)):
            contents[words] = str(count)  # a camera without frames holds one member `empty`
    if (folder / "dataset_sim.npz").exists():
        contents["truth"] = "exact twists of a simulation"
    if (folder / "dataset_events_id.npy").exists():
        contents["object ids"] = f"of {len(mapped(folder / 'dataset_events_id.npy')):,} events"
    if (imu := folder / "dataset_imu.npz").exists():
        contents["IMU"] = f"{Archive(imu).header('t_us').shape[0]:,} samples"
    if (folder / "dataset_info.npz").exists():
        contents["meta"] = "poses and IMU, pickled: not opened"
    return contents
