"""`evimo simulate`: recordings with exact truth from seeds."""

import re
from pathlib import Path
from typing import Literal

from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, TextColumn, TimeRemainingColumn
from rich.text import Text

from evimo.errors import BadInput


def simulate(
    *,
    set: str = "all",
    minutes: float,
    seed: int = 0,
    out: Path,
    size: str = "346x260",
    seconds: float = 1.0,
    camera: Literal["random", "evimo"] = "random",
    workers: int = 1,
) -> None:
    """Simulate recordings of a moving event camera with exact depth, ids and motion.

    Each recording is a folder made from its own seed, complete as soon as it exists; the same command again makes only
    those that are missing.

    Args:
        set: one of the paper's six sets, 1 to 6, or all of them in turn.
        minutes: of recording, together.
        seed: of the first recording; the others follow.
        out: folder for the recordings.
        size: of the sensor, WxH in pixels.
        seconds: of each recording.
        camera: random lenses, or EV-IMO's own scaled to the size.
        workers: processes.
    """
    from evimo.simulate.dataset import DatasetPlan, simulate_dataset

    plan = DatasetPlan(
        set_number=_set_number(set), minutes=minutes, seed=seed, seconds=seconds, camera=camera, size=_size(size)
    )
    columns = (TextColumn("simulate"), BarColumn(), MofNCompleteColumn(), _Rate(), TimeRemainingColumn())
    with Progress(*columns) as progress:
        task = progress.add_task("recordings", total=plan.recordings)
        for _ in simulate_dataset(plan, out, workers=workers):
            progress.advance(task)


class _Rate(ProgressColumn):
    """Recordings per second."""

    def render(self, task) -> Text:  # type: ignore[no-untyped-def]
        speed = task.finished_speed or task.speed
        return Text(f"{speed:.2f} recordings/s" if speed else "", style="progress.data.speed")


def _set_number(text: str) -> int:
    if text != "all" and text not in "123456":
        raise BadInput(f"no set {text!r}", fix="a set from 1 to 6, or all")
    return 0 if text == "all" else int(text)


def _size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d+)x(\d+)", text)
    if not match:
        raise BadInput(f"no size {text!r}", fix="WxH, as 346x260")
    return int(match[2]), int(match[1])
