"""EV-IMO (and better-flow) .npz recordings: one array `events` of rows t x y p, beside depth, mask, K and D."""

import json
import math
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.arguments import size_of
from evimo.errors import BadFile, BadInput, EvimoWarning
from evimo.events.events import Events
from evimo.formats.clock_rules import NO_TIME
from evimo.formats.columns import check_pixels, check_polarities, signs
from evimo.formats.event_file import EventFile, FoundCamera, camera_of_matrix, found_camera
from evimo.formats.npz_members import Archive
from evimo.formats.npz_rows import NpzRows
from evimo.formats.sensors import assumed_sensor, extent_of, fitting_sensor, on_sign, upright, whole_pixels
from evimo.formats.stored_gyroscope import simulated_gyroscope
from evimo.formats.survey import no_events_in, surveyed
from evimo.formats.time_units import NAMES, Times, TimeUnit, as_us, check_span, found_unit, repeat_of, step_of
from evimo.formats.wraps import Reached, continued
from evimo.geometry.camera import Camera

PIECE_ROWS = 2000
FACTS = "sim_facts"  # only in our own files


def open_evimo_npz(
    path: Path, sensor: tuple[int, int] | None = None, *, time_unit: TimeUnit | None = None, columns: str | None = None
) -> EventFile:
    """Open a recording; `t` is usually in seconds where the array is of floats, in µs where it is of integers.

    Nothing is unpickled: `meta` stays closed. The size is that of `depth` or `mask`, K that of `K`. `D` is ignored
    with a warning where it is not zero, as those of the released files are known to be wrong. Files that `evimo
    simulate` has made tell their whole lens in `sim_facts`, JSON.

    Raises:
        BadFile: no numeric `events` of four columns, or nothing readable; times of no camera; a damaged `sim_facts`.
    """
    archive = Archive(path)
    rows = NpzRows(archive, columns)
    offset = _offset(archive)
    unit = _unit(path, rows, sensor, time_unit, offset=offset)
    added_us = int(as_us(offset, unit)[0])
    survey = surveyed(path, _blocks(rows, unit, (0, Reached()), added_us))
    if survey.stored < rows.count:
        text = f"{path.name} is cut short: {survey.stored:,} of {rows.count:,} events are readable and used"
        warnings.warn(text, EvimoWarning, stacklevel=3)
    if time_unit is None:
        check_span(path, events=survey.events, span_us=survey.stop_us - survey.start_us, unit=unit)
    size = sensor or upright(path, _map_size(archive), survey.extent) or assumed_sensor(path, survey.extent)
    sign = np.int8(on_sign(path))

    def read(start_us: int) -> Iterator[Events]:
        blocks = _blocks(rows, unit, survey.place(start_us), added_us)
        return (Events(each.x, each.y, each.t, sign * each.p) for _, each in blocks)

    return EventFile(
        path=path,
        format=f"EV-IMO npz (times in {NAMES[unit]})",
        sensor=size,
        start_us=survey.start_us,
        stop_us=survey.stop_us,
        read=read,
        camera=_camera(archive, size),
        read_gyroscope=lambda: simulated_gyroscope(archive, "sim_imu_"),
        contents=_contents(archive),
    )


def _offset(archive: Archive) -> NDArray[Any]:
    """What is to be added to all times, (1,): 0, or `t_offset`.

    Raises:
        BadFile: it is no number.
    """
    offset = archive.small("t_offset").reshape(-1) if "t_offset" in archive.names else np.zeros(1, np.int64)
    if offset.shape != (1,) or offset.dtype.kind not in "iuf" or not np.isfinite(offset).all():
        text = f"{archive.path.name}: its t_offset {offset.tolist()!s:.40} is no number"
        raise BadFile(text, fix="export it again")
    return offset


def _unit(
    path: Path, rows: NpzRows, sensor: tuple[int, int] | None, said: TimeUnit | None, *, offset: NDArray[Any]
) -> TimeUnit:
    """The unit of the times, said or from the first events."""
    _, first = next(rows.blocks(), (0, None))
    if first is None:
        raise no_events_in(path)
    t, x, y, p = first
    check_polarities(path, p)
    check_pixels(path, x, y)
    height, width = sensor or fitting_sensor((extent_of(whole_pixels(y)), extent_of(whole_pixels(x))))
    pieces = [np.asarray(t[at : at + PIECE_ROWS], np.float64) + offset for at in range(0, len(t), PIECE_ROWS)]
    times = Times(pieces, step_of(t), height * width, repeat_of(x, y, t))
    return found_unit(path, times, said=said, usual="s" if t.dtype.kind == "f" else "us")


def _blocks(
    rows: NpzRows, unit: TimeUnit, place: tuple[int, Reached], added_us: int
) -> Iterator[tuple[tuple[int, Reached], Events]]:
    """Blocks of events from a row on, all times later by `added_us`, and the state of their counter before each."""
    reached = place[1]
    for row, block in rows.blocks(place[0]):
        events, before = _as_events(block, unit), reached
        t, reached = continued(events.t, before)
        yield (row, before), Events(events.x, events.y, t + added_us if added_us else t, events.p)


def _as_events(columns: list[NDArray[Any]], unit: TimeUnit) -> Events:
    """Events of one block; a value that is no number puts its event outside of the sensor or of time."""
    t, x, y, p = columns
    t_us = as_us(t, unit)
    if p.dtype.kind == "f":
        t_us[np.isnan(p)] = NO_TIME
    return Events(whole_pixels(x), whole_pixels(y), t_us, signs(p))


def _map_size(archive: Archive) -> tuple[int, int] | None:
    told = [archive.header(side).shape for side in ("height", "width") if side in archive.names]
    if [math.prod(shape) for shape in told] == [1, 1]:
        sides = [archive.small(side).reshape(-1) for side in ("height", "width")]
        try:
            return size_of(np.concatenate(sides), "height and width")
        except BadInput as error:
            raise BadFile(f"{archive.path.name}: {error.problem}", fix="give it with --sensor WxH") from error
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
        if name in archive.names and not archive.is_pickled(name):  # a camera without frames holds a pickled None
            contents[words] = str(archive.header(name).shape[0])
    if "meta" in archive.names:
        contents["meta"] = "poses, pickled: not opened" if archive.is_pickled("meta") else "poses, as text"
    if FACTS in archive.names:
        contents["truth"] = "exact motion of a simulation"
    for name, words, of in (("sim_event_ids", "object ids", "of {:,} events"), ("sim_imu_t_us", "IMU", "{:,} samples")):
        if name in archive.names:
            contents[words] = of.format(archive.header(name).shape[0])
    return contents
