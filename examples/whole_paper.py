"""The whole of EV-IMO in one go: capture the six sets, make their truth from motion capture, train on it, and score.

python examples/whole_paper.py OUT [--minutes 0.5] [--size 346x260] [--steps 1000] [--seed 0]

The paper filmed toys in a room full of motion capture cameras. Here the simulator stands for room, sensor and motion
capture: it leaves captures as a laboratory would, and knows exactly what annotation should make of them.
"""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cyclopts
import numpy as np
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

import evimo
from evimo.annotate.annotation import Annotation, Instants
from evimo.captures.capture import open_capture
from evimo.cli.boundary import outcome
from evimo.cli.progress import progress
from evimo.cli.simulate import pixels_of
from evimo.cli.train import train
from evimo.errors import BadInput
from evimo.evaluation.columns import BY_NAME
from evimo.evaluation.metrics import overlap
from evimo.evaluation.tables import cell, header
from evimo.simulate.plan import SLICE_S, RecordingPlan
from evimo.simulate.recording import simulate_recording
from evimo.simulate.virtual_capture import RECORDING, MocapErrors, capture_virtually

# Part, set of the paper's Table I, room: one recording each. As in the paper, boxes and floor are for training; the
# textures of the test part are of its own.
TRAINING = (("train", 1, "boxes"), ("train", 2, "floor")) * 3
TESTING = tuple(
    ("test", number, room) for number, room in enumerate(("boxes", "wall", "table", "tabletop", "tabletop", "boxes"), 1)
)
SESSIONS = TRAINING + TESTING
ERRORS = MocapErrors(offset_us=12_345)  # 200 Hz, 0.2 mm and 0.5 mrad of noise, 2 % of samples lost, another clock
SCORES = tuple(BY_NAME[name] for name in ("iou", "event_iou", "flow", "camera_aee", "camera_rre", "abs_rel"))


def whole_paper(out: Path, *, minutes: float = 0.5, size: str = "346x260", steps: int = 1000, seed: int = 0) -> None:
    """Capture, annotate, compare, train and score.

    Args:
        out: folder to make.
        minutes: of recording in all, an hour at most; each of the twelve recordings has two slices of 25 ms or more.
        size: of the pictures, px.
        steps: of training, 8 samples each.
        seed: of the scenes and of the first weights.
    """
    if out.exists():
        raise BadInput(f"{out} is there already", fix="another folder: all is made anew, and timed")
    if not 0 < minutes <= 60:  # of longer captures annotation makes several recordings
        raise BadInput(f"{minutes:g} minutes of recording", fix="--minutes 0.5")
    slices = max(2, round(minutes * 60 / len(SESSIONS) / SLICE_S))
    took: dict[str, float] = {}
    with timed("simulate and capture", took), progress(len(SESSIONS), "captures") as advance:
        for number, (part, set_number, room) in enumerate(SESSIONS):
            plan = RecordingPlan(
                seed=seed * len(SESSIONS) + number,
                set_number=set_number,
                seconds=round(slices * SLICE_S, 3),
                camera="evimo",
                size=pixels_of(size),
                part=part,
                room=room,
                population="replica",
            )
            folder = out / "captures" / part / f"{number:02d}_set{set_number}_{room}"
            capture_virtually(simulate_recording(plan), folder, ERRORS)
            advance()
    with timed("annotate", took), progress(len(SESSIONS), "captures") as advance:
        for capture in captures(out):
            annotation = Annotation(open_capture(capture), Instants(rate=40))
            list(annotation.write(truth(out, capture).parent, 0))
            advance()
    with timed("compare with the exact truth", took):
        rows = [[f"{capture.parent.name}, {capture.name}", *agreement_of(out, capture)] for capture in captures(out)]
        show(["annotated", "frames", "IoU of objects", "mean depth error", "depth within 1 %"], rows)
    with timed("train", took):
        train(out / "truth" / "train", preset="tiny", steps=steps, seed=seed, out=out / "tiny", threads=1)
    with timed("score", took):
        report = evimo.evaluate(out / "truth" / "test", model=out / "tiny" / "model.onnx")
        rows = [[row, *(cell(each.get(column.name), column) for column in SCORES)] for row, each in report.rows.items()]
        show(["held-out part", *map(header, SCORES)], rows)
    show(["stage", "s"], [[stage, f"{seconds:.1f}"] for stage, seconds in took.items()])


def captures(out: Path) -> list[Path]:
    """The folders of all captures, in the order in which they were made."""
    return sorted((out / "captures").glob("*/*"), key=lambda folder: folder.name)


def truth(out: Path, capture: Path) -> Path:
    """The recording with truth that is made of a capture."""
    return out / "truth" / capture.parent.name / f"{capture.name}_000000"


def agreement_of(out: Path, capture: Path) -> tuple[str, ...]:
    """How near the annotated truth of a capture is to what the simulator knows."""
    made, exact = evimo.open_recording(truth(out, capture)), evimo.open_recording(capture / RECORDING)
    areas, errors = np.zeros(2, int), list[np.ndarray]()
    for one, other in ((made.truth(k), exact.truth_at(t_us)) for k, t_us in enumerate(made.times_us.tolist())):
        areas += overlap(one.ids > 0, other.ids > 0)
        both = one.valid & other.valid
        errors.append(np.abs(one.depth[both] / other.depth[both] - 1))
    error = np.concatenate(errors)
    iou = f"{areas[0] / areas[1]:.3f}" if areas[1] else "–"
    return f"{len(made)} of {len(exact)}", iou, f"{np.mean(error):.2%}", f"{np.mean(error < 0.01):.1%}"


@contextmanager
def timed(stage: str, took: dict[str, float]) -> Iterator[None]:
    """Note how many seconds a stage takes, under its name."""
    start_s = time.perf_counter()
    yield
    took[stage] = time.perf_counter() - start_s


def show(head: list[str], rows: list[list[str]]) -> None:
    """Print a table."""
    table = Table(*head, box=SIMPLE)
    for row in rows:
        table.add_row(*row)
    Console(width=120).print(table)


if __name__ == "__main__":
    sys.exit(outcome(lambda: cyclopts.run(whole_paper)))
