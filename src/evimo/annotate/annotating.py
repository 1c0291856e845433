"""Captures made into recordings with truth, by whoever works on them: each recording is one job, done once."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

from evimo.annotate.annotation import Annotation
from evimo.errors import BadInput
from evimo.jobs.crew import ALONE, Crew
from evimo.jobs.finishing import finished
from evimo.recordings.facts import facts_of


class Part(NamedTuple):
    """One recording to be made of a capture: the stretch of that number."""

    annotation: Annotation
    number: int


class DrawnPart(NamedTuple):
    """What became of a part: how many instants it has, and at how many of them frames were drawn now."""

    instants: int
    frames: int


def annotate_captures(
    annotations: Iterable[Annotation],
    out: Path,
    *,
    crew: Crew = ALONE,
    progress: Callable[[int], object] = lambda frames: None,
) -> Iterator[DrawnPart]:
    """Write the recordings of captures that do not exist yet, and tell of each when it is complete.

    Args:
        annotations: the captures, and what is to be made of them.
        out: folder for the recordings.
        crew: who draws; each works on a whole recording, and has the capture's scans in memory meanwhile.
        progress: is called with how many more frames are drawn: after each one where this process draws, else after
            each recording.

    Raises:
        NotFound, BadFile: a file of a capture is missing or damaged, or its camera was never tracked; comes after all
            other recordings. BadInput: a capture is not calibrated yet, a recording that is there was made at other
            times or with other settings, or `out` cannot be written.
    """
    annotations = list(annotations)
    for annotation in annotations:
        _check_made_alike(annotation, out)
    missing = [Part(annotation, number) for annotation in annotations for number in annotation.missing(out)]
    work = partial(write_part, out, told=progress if crew.is_alone else None)
    for drawn in finished(work, missing, crew=crew, shared=out, name=_folder):
        if not crew.is_alone:
            progress(drawn.frames)
        yield drawn


def _check_made_alike(annotation: Annotation, out: Path) -> None:
    for path in (annotation.path(out, part) for part in annotation.frames):
        if path.exists() and (made := facts_of(path).get("made_from")) != annotation.made_from:
            wanted, was = annotation.made_from["times"], made["times"] if isinstance(made, dict) else "unknown ones"
            other = "other settings of its capture" if was == wanted else f"times {was} instead of {wanted}"
            raise BadInput(f"{path} is there already, made with {other}", fix="another --out, or remove it")


def write_part(out: Path, part: Part, *, told: Callable[[int], object] | None = None) -> DrawnPart:
    """Write one recording, if it is not there yet; its scans go from memory with it."""
    annotation, frames = replace(part.annotation), 0
    if not annotation.path(out, part.number).exists():
        for _ in annotation.write(out, part.number):
            frames += 1
            if told is not None:
                told(1)
    return DrawnPart(annotation.frames[part.number], frames)


def _folder(part: Part) -> Path:
    """Of the capture, for errors."""
    return part.annotation.capture.path.parent
