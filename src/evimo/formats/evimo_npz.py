"""EV-IMO (and better-flow) .npz recordings: one array `events` of rows t x y p, beside depth, mask, K and D."""

import json
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile, BadInput, EvimoWarning
from evimo.events.events import Events
from evimo.formats.event_file import EventFile, FoundCamera, camera_of_matrix, found_camera
from evimo.formats.npz_members import Archive, ArrayHeader, skip
from evimo.formats.sensors import assumed_sensor
from evimo.formats.stored_gyroscope import simulated_gyroscope
from evimo.formats.survey import surveyed
from evimo.geometry.camera import Camera

BLOCK_ROWS = 1 << 16
FACTS = "sim_facts"  # only in our own files


def open_evimo_npz(path: Path, sensor: tuple[int, int] | None = None) -> EventFile:
    """Open a recording; `t` is in seconds where the array is of floats, in µs where it is of integers.

    Nothing is unpickled: `meta` stays closed. The size is that of `depth` or `mask`, K that of `K`. `D` is ignored
    with a warning where it is not zero, as those of the released files are known to be wrong. Files that `evimo
    simulate` has made tell their whole lens in `sim_facts`, JSON.

    Raises:
        BadFile: no numeric `events` of four columns, not a number in it, or nothing readable; a damaged `sim_facts`.
    """
    archive = Archive(path)
    header = _events_header(archive)
    survey = surveyed(path, _blocks(archive, header, 0))
    if survey.stored < header.shape[0]:
        text = f"{path.name} is cut short: {survey.stored:,} of {header.shape[0]:,} events are readable and used"
        warnings.warn(text, EvimoWarning, stacklevel=3)
    size = sensor or _map_size(archive) or assumed_sensor(path, survey.extent)

    def read(start_us: int) -> Iterator[Events]:
        return (events for _, events in _blocks(archive, header, survey.place(start_us)))

    return EventFile(
        path=path,
        format="EV-IMO npz",
        sensor=size,
        start_us=survey.start_us,
        stop_us=survey.stop_us,
        read=read,
        camera=_camera(archive, size),
        read_gyroscope=lambda: simulated_gyroscope(archive, "sim_imu_"),
        contents=_contents(archive),
    )


def _events_header(archive: Archive) -> ArrayHeader:
    if "events" not in archive.names:
        names = ", ".join(sorted(archive.names)[:8])
        raise BadFile(
            f"{archive.path.name} holds no array `events`, only {names}", fix="save the rows t x y p as `events`"
        )
    header = archive.header("events")
    named = header.dtype.names is not None and {"t", "x", "y", "p"} <= set(header.dtype.names)
    if not named and (len(header.shape) != 2 or header.shape[1] != 4 or header.dtype.kind not in "iuf"):
        raise BadFile(
            f"`events` in {archive.path.name} has shape {header.shape} of {header.dtype}",
            fix="save it as (N, 4) numbers: t x y p",
        )
    return header


def _blocks(archive: Archive, header: ArrayHeader, row: int) -> Iterator[tuple[int, Events]]:
    """The events from a row on, in blocks: (first row, events)."""
    by_column = header.fortran_order and header.dtype.names is None
    for block in _by_column(archive, header, row) if by_column else _by_row(archive, header, row):
        yield row, _as_events(block, archive.path, row)
        row += len(block[0])


def _by_row(archive: Archive, header: ArrayHeader, row: int) -> Iterator[list[NDArray[Any]]]:
    names = header.dtype.names
    row_bytes = header.dtype.itemsize * (1 if names else 4)
    stream = archive.stream("events")
    skip(stream, header.offset + row * row_bytes)
    while len(raw := stream.read(BLOCK_ROWS * row_bytes)) >= row_bytes:
        flat = np.frombuffer(raw[: len(raw) // row_bytes * row_bytes], header.dtype)
        yield [flat[name] for name in "txyp"] if names else list(flat.reshape(-1, 4).T)


def _by_column(archive: Archive, header: ArrayHeader, row: int) -> Iterator[list[NDArray[Any]]]:
    """Column after column in the file: one stream for each."""
    rows, item = header.shape[0], header.dtype.itemsize
    streams = [archive.stream("events") for _ in range(4)]
    for column, stream in enumerate(streams):
        skip(stream, header.offset + (column * rows + row) * item)
    while row < rows:
        raw = [stream.read(min(BLOCK_ROWS, rows - row) * item) for stream in streams]
        whole = min(map(len, raw)) // item
        if not whole:
            return
        yield [np.frombuffer(part[: whole * item], header.dtype) for part in raw]
        row += whole


def _as_events(columns: list[NDArray[Any]], path: Path, row: int) -> Events:
    t, x, y, p = columns
    if t.dtype.kind == "f":
        t = np.asarray(t, np.float64) * 1e6
    if not all(np.isfinite(column).all() for column in (t, x, y, p)):
        raise BadFile(
            f"{path.name}: `events` holds nan or infinity near row {row:,}", fix="export it again without them"
        )
    return Events(_pixels(x), _pixels(y), np.rint(t).astype(np.int64), np.where(p > 0, 1, -1).astype(np.int8))


def _pixels(values: NDArray[Any]) -> NDArray[np.uint16]:
    """Whole pixels; what cannot be one becomes 65535, which is outside every sensor."""
    inside = (values >= 0) & (values < 65535)
    return np.where(inside, np.rint(np.where(inside, values, 0)), 65535).astype(np.uint16)


def _map_size(archive: Archive) -> tuple[int, int] | None:
    for name in ("depth", "mask"):
        if name in archive.names and len(shape := archive.header(name).shape) >= 2:
            return shape[-2], shape[-1]
    return None


def _camera(archive: Archive, size: tuple[int, int]) -> FoundCamera | None:
    if FACTS in archive.names:
        return FoundCamera(_own_camera(archive, size), f"{FACTS} in {archive.path.name}")
    camera = None
    if "K" in archive.names:
        matrix = archive.small("K")
        camera = found_camera(lambda: camera_of_matrix(matrix, size), f"K in {archive.path.name}")
    if "D" in archive.names and archive.small("D").any():
        text = f"{archive.path.name}: the distortion `D` is ignored, as such files are known to hold wrong ones"
        warnings.warn(text, EvimoWarning, stacklevel=4)
    return camera


def _own_camera(archive: Archive, size: tuple[int, int]) -> Camera:
    """The lens of a simulated recording, from the text that says how it was made."""
    try:
        lens = json.loads(str(archive.small(FACTS).item()))["camera"]
        return Camera(
            **{name: float(lens[name]) for name in ("fx", "fy", "cx", "cy")},
            height=size[0],
            width=size[1],
            distortion=tuple(float(value) for value in lens["distortion"]),
            lens=lens["lens"],
        )
    except (ValueError, KeyError, TypeError, BadInput) as error:
        raise BadFile(
            f"`{FACTS}` in {archive.path.name} is not the JSON of a simulated recording", fix="simulate it again"
        ) from error


def _contents(archive: Archive) -> dict[str, str]:
    contents: dict[str, str] = {}
    for name, words in (("depth", "depth maps"), ("mask", "masks"), ("classical", "frames")):
        if name in archive.names:
            contents[words] = str(archive.header(name).shape[0])
    if "meta" in archive.names:
        contents["meta"] = "poses, as text" if _is_text(archive, "meta") else "poses, pickled: not opened"
    if FACTS in archive.names:
        contents["truth"] = "exact motion of a simulation"
    for name, words, of in (("sim_event_ids", "object ids", "of {:,} events"), ("sim_imu_t_us", "IMU", "{:,} samples")):
        if name in archive.names:
            contents[words] = of.format(archive.header(name).shape[0])
    return contents


def _is_text(archive: Archive, name: str) -> bool:
    try:
        return archive.header(name).dtype.kind == "U"
    except BadFile:
        return False
