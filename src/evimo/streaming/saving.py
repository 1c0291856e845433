"""A whole run saved: every output complete, or none."""

import json
import time
import warnings
from collections.abc import Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from evimo.errors import EvimoWarning
from evimo.streaming.outputs import OPTIONAL, Outputs
from evimo.streaming.pipeline import Run
from evimo.streaming.summary import Course, summary
from evimo.writing import OutputFolder

FIX = "another --out folder, more room on the disk, or fewer outputs: --no-dense, --no-video, no --event-labels"


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """What a run should leave beside its tables and its summary.

    dense:       `estimates.h5`.
    video_speed: of `video.mp4`, 1 being real time; None for no video.
    """

    dense: bool
    video_speed: float | None


@dataclass(frozen=True, slots=True)
class Saved:
    """What a run left: the content of `summary.json`, and its files."""

    summary: dict[str, Any]
    files: list[Path]


class Control:
    """What the caller may hang into a run: hear of finished slices, stop it, and pass on the warnings it collected."""

    def __init__(self, *, warnings: Sequence[str] = ()) -> None:
        self.warnings = warnings
        self.stopped = False

    def finished_slice(self) -> None:
        """Called after each slice."""


def save_run(
    run: Run, out: str | Path, wanted: Wanted, *, settings: dict[str, Any] | None = None, control: Control | None = None
) -> Saved | None:
    """Do a run and leave its outputs in the folder `out`; None if it was stopped before its first slice was done.

    A run that is stopped leaves complete outputs of the slices that were done; one that fails leaves nothing, and what
    was in the folder stays.

    Args:
        run: prepared, not yet started.
        out: folder, made where missing.
        wanted: which outputs.
        settings: of the caller, for `summary.json`.
        control: see there.

    Raises:
        BadInput: the folder cannot be written, or its disk is full.
        BadFile: the recording turns out to be broken.
    """
    control = control or Control()
    with OutputFolder(out, fix=FIX) as folder:
        course = _write_all(run, folder, wanted, control)
        if not course.slices:
            return None
        for name in folder.left_over(OPTIONAL):
            warnings.warn(f"{folder.folder / name} is from an earlier run", EvimoWarning, stacklevel=2)
        content = summary(run, course, settings=asdict(wanted) | (settings or {}), warnings=control.warnings)
        folder.path("summary.json").write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
        return Saved(content, folder.keep())


def _write_all(run: Run, folder: OutputFolder, wanted: Wanted, control: Control) -> Course:
    started_s = first_s = time.perf_counter()
    count = 0
    outputs = Outputs(folder, run, dense=wanted.dense, video_speed=wanted.video_speed)
    with closing(outputs), closing(run.slices()) as slices:
        for estimate, events in slices:
            if control.stopped:
                break
            first_s = first_s if count else time.perf_counter()
            outputs.write(estimate, events)
            count += 1
            control.finished_slice()
    return Course(
        slices=count,
        startup_s=first_s - started_s,
        running_s=time.perf_counter() - first_s,
        interrupted=count < len(run.span),
    )
