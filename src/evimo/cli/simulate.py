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
    sensor: Literal["davis346", "davis240", "dvxplorer", "gen4", "samsung"] = "davis346",
    size: str | None = None,
    seconds: float = 1.0,
    camera: Literal["random", "evimo"] = "random",
    layout: Literal["evimo2", "evimo1"] = "evimo2",
    events: Literal["aedat4", "raw"] | None = None,
    workers: int = 1,
) -> None:
    """Simulate recordings of a moving event camera with exact depth, ids and motion.

    Each recording is a folder (or, as evimo1, a file) made from its own seed, complete as soon as it exists; the same
    command again makes only those that are missing.

    Args:
        set: one of the paper's six sets, 1 to 6, or all of them in turn.
        minutes: of recording, together.
        seed: of the first recording; the others follow.
        out: folder for the recordings.
        sensor: size, thresholds and noise of this event camera.
        size: WxH in pixels, if not the sensor's own.
        seconds: of each recording.
        camera: random lenses, or EV-IMO's own scaled to the size.
        layout: of EVIMO2, a folder, which is what the other commands take, or of EV-IMO's first version, an .npz.
        events: beside each recording, its events alone as AEDAT 4 or as Prophesee RAW (EVT 2.0).
        workers: processes.
    """
    from evimo.simulate.dataset import DatasetPlan, simulate_dataset

    plan = DatasetPlan(
        set_number=_set_number(set),
        minutes=minutes,
        seed=seed,
        seconds=seconds,
        camera=camera,
        sensor=sensor,
        size=None if size is None else _size(size),
        layout=layout,
        events=events,
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
