"""Captures to recordings with truth: events as they are, depth, objects and motion drawn at the times asked for."""

import json
import math
import warnings
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from functools import cached_property, partial
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.annotate.lens import lens_tables
from evimo.annotate.tracked import ROOM, VOID, Placed, TrackedScene, tracked_scene
from evimo.annotate.zbuffer import drawn
from evimo.captures.capture import Capture
from evimo.errors import BadFile, BadInput, EvimoWarning, NotFound
from evimo.events.events import Events, joined
from evimo.events.slices import SLICE_US
from evimo.formats.event_file import EventFile
from evimo.geometry.camera import Camera
from evimo.jobs.crew import cores
from evimo.recordings.facts import own_version
from evimo.recordings.truth import Truth
from evimo.recordings.writers import SUFFIXES, Writer, check_dataset_layout, writer_of

I8 = NDArray[np.int64]

PART_US = 12_000 * SLICE_US  # five minutes: what a recording keeps in memory while it is written stays small
AT_ONCE = 32  # frames that are drawn ahead of the one that is written
MOST_HZ = 10_000.0


@dataclass(frozen=True)
class Instants:
    """The times at which truth is made: so many per second, or those of a list.

    rate: per second; the middles of intervals of 1/rate, so that 40 and 200 have those of all slices of 25 ms.
    listed_us: (N,) rising times instead.
    """

    rate: float = 40.0
    listed_us: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        if not 0 < self.rate <= MOST_HZ:
            raise BadInput(f"a rate of {self.rate} per second", fix="40, 200, or a text with a time in µs per line")

    def told(self) -> str:
        """Which times these are, in a few words."""
        if self.listed_us is None:
            return f"{self.rate:g} per second"
        return f"{len(self.listed_us)} of sha256 {_sum_of(self.listed_us)}"

    def between(self, start_us: int, stop_us: int) -> I8:
        """The times with start <= t < stop."""
        if self.listed_us is not None:
            listed = np.array(self.listed_us, np.int64)
            return listed[(listed >= start_us) & (listed < stop_us)]
        first, last = (math.floor(t_us * self.rate / 1e6) for t_us in (start_us, stop_us))
        times = np.rint((np.arange(first, last + 1) + 0.5) * (1e6 / self.rate)).astype(np.int64)
        return times[(times >= start_us) & (times < stop_us)]


def instants_of(text: str) -> Instants:
    """The instants that a user asks for: a number per second, or the path of a text with a time in µs per line.

    Raises:
        NotFound: no number, and no such file. BadFile: a line is no whole number, or the times do not rise.
    """
    try:
        return Instants(rate=float(text))
    except ValueError:
        pass
    path = Path(text)
    if not path.is_file():
        raise NotFound(f"no rate and no file: {text}", fix="40, 200, or a text with a time in µs per line")
    times: list[int] = []
    for number, line in enumerate(path.read_text(errors="replace").splitlines(), 1):
        word = line.partition("#")[0].strip()
        if word and not word.lstrip("-").isdecimal():
            raise BadFile(f"{path}, line {number}: {word[:40]!r} is no time", fix="a whole number of µs per line")
        times += [int(word)] if word else []
        if len(times) > 1 and times[-1] <= times[-2]:
            raise BadFile(f"{path}, line {number}: {times[-1]} is not after {times[-2]}", fix="sort the times")
    return Instants(listed_us=tuple(times))


@dataclass(frozen=True)
class Annotation:
    """A capture and what is to be made of it.

    layout: `evimo2`, a folder, or `evimo1`, an .npz. threads: that draw; None for one on each core that there is.
    """

    capture: Capture
    instants: Instants
    layout: str = "evimo2"
    threads: int | None = None

    def __post_init__(self) -> None:
        check_dataset_layout(self.layout)
        if self.threads is not None and self.threads < 1:
            raise BadInput(f"{self.threads} threads", fix="1 or more")

    def __reduce__(self) -> tuple[Any, ...]:
        """How it goes to another process, which opens the files and loads the scans itself."""
        return Annotation, (self.capture, self.instants, self.layout, self.threads)

    @cached_property
    def events(self) -> EventFile:
        """The events of the capture."""
        return self.capture.recording.opened()

    @cached_property
    def camera(self) -> Camera:
        """The camera of the capture."""
        return self.capture.lens(self.events)

    @cached_property
    def scene(self) -> TrackedScene:
        """Its poses and scans."""
        return tracked_scene(self.capture)

    @cached_property
    def frames(self) -> dict[int, int]:
        """How many instants each of its recordings has, which last five minutes; those without any are left out.

        Raises:
            BadInput: there is none in the whole recording.
        """
        count = math.ceil((self.events.stop_us - self._origin_us) / PART_US)
        frames = {part: len(self.instants.between(*self.span(part))) for part in range(count)}
        if not any(frames.values()):
            span = f"{self.events.start_us} to {self.events.stop_us}"
            raise BadInput(
                f"none of the times lies in {self.events.path.name}, {span} µs", fix="times in its own clock"
            )
        return {part: number for part, number in frames.items() if number}

    @property
    def _origin_us(self) -> int:
        return self.events.start_us // SLICE_US * SLICE_US

    def span(self, part: int) -> tuple[int, int]:
        """From when to when a part lasts."""
        start_us = self._origin_us + part * PART_US
        return start_us, min(start_us + PART_US, self.events.stop_us)

    def path(self, out: Path, part: int) -> Path:
        """Where a part goes, named as EVIMO2 names the parts of its sequences."""
        return out / f"{self.name}_{part:06d}{SUFFIXES[self.layout]}"

    @property
    def name(self) -> str:
        """That of the capture's folder."""
        return self.capture.path.resolve().parent.name

    @cached_property
    def made_from(self) -> dict[str, str]:
        """What else its recordings follow from than the files: the times, and a sum of all settings of the capture."""
        return {"times": self.instants.told(), "settings": _sum_of(asdict(self.capture))}

    def missing(self, out: Path) -> list[int]:
        """The parts that are not there yet."""
        return [part for part in self.frames if not self.path(out, part).exists()]

    def times(self, part: int) -> I8:
        """The instants of a part at which the camera was tracked."""
        times_us = self.instants.between(*self.span(part))
        if not len(times_us):
            return times_us
        return times_us[self.scene.camera.path.at(times_us).valid]

    def write(self, out: Path, part: int) -> Iterator[int]:
        """Make one part, and yield after each instant how many of its frames are done.

        A part of several at none of whose instants the camera was tracked is left out, with a warning.

        Raises:
            NotFound: the camera was tracked at none of the instants of the only part. BadInput: it cannot be written.
        """
        times_us = self.times(part)
        if not len(times_us):
            start_us, stop_us = self.span(part)
            problem = f"{self.capture.path}: no pose of the camera from {start_us} to {stop_us} µs of the recording"
            if len(self.frames) > 1:
                warnings.warn(f"{problem}, which is left out", EvimoWarning, stacklevel=2)
                return
            fix = "`offset_us` in `mocap` brings the clock of motion capture to that of the events"
            raise NotFound(problem, fix=fix)
        borders = np.append((times_us[1:] + times_us[:-1]) // 2, self.span(part)[1])
        cut = events_until(self.events.packets(*self.span(part)), borders)
        with self._writer(self.path(out, part)) as writer:
            for number, (events, truth) in enumerate(zip(cut, self.truths(times_us), strict=True), 1):
                writer.write(events, truth)
                yield number

    def truths(self, times_us: I8) -> Iterator[Truth]:
        """Everything at times (F,) at which the camera was tracked, drawn by several threads, a few ahead."""
        lens, scene = lens_tables(self.camera), self.scene
        with ThreadPoolExecutor(self.threads or cores()) as pool:
            for first in range(0, len(times_us), AT_ONCE):
                placed = scene.at(times_us[first : first + AT_ONCE])
                draw = partial(_truth, scene, lens, placed)
                yield from pool.map(draw, range(len(placed.valid)))

    def _writer(self, path: Path) -> Writer:
        facts: dict[str, Any] = {"version": own_version(), "made_by": "evimo annotate", "capture": self.name}
        facts |= {"objects": self._names(), "made_from": self.made_from}
        return writer_of(self.layout, path, self.camera, facts=facts, poses=self.scene.poses)

    def _names(self) -> dict[str, int]:
        return {each.name: each.id for each in self.capture.objects}


def _sum_of(settings: object) -> str:
    """A short sum of numbers, words, arrays and the names of files, wherever these lie."""
    words = json.dumps(settings, default=lambda each: each.name if isinstance(each, Path) else each.tolist())
    return sha256(words.encode()).hexdigest()[:12]


def _truth(scene: TrackedScene, lens: object, placed: Placed, k: int) -> Truth:
    """The truth at one of the times."""
    depth, seen = drawn(scene.surfaces, lens, placed.cam_from_scan[k], placed.codes[k], scene.fine)
    valid = (seen > 0) & (seen != VOID)
    ids = np.where(seen < ROOM, seen, 0).astype(np.uint8)
    clutter = np.zeros(depth.shape, np.bool_)
    depth = np.where(valid, depth, 0).astype(np.float32)
    t_us = int(placed.track.times_us[k])
    return Truth(t_us, depth, valid, ids, clutter, placed.ego[k], placed.objects[k])


def events_until(packets: Iterable[Events], borders: I8) -> Iterator[Events]:
    """Cut packets at rising times (F,): from one to the next, from the start to the first, none after the last."""
    waiting, coming = joined([]), iter(packets)
    for border in borders.tolist():
        parts = [waiting]
        while not len(parts[-1]) or parts[-1].t[-1] < border:
            newest = next(coming, None)
            if newest is None:
                break
            parts.append(newest)
        whole = joined(parts)
        cut = int(np.searchsorted(whole.t, border))
        yield whole.part(0, cut)
        waiting = whole.part(cut, len(whole))
