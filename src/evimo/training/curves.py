"""What a run shows of itself: learning curves and a few pictures, as CSV files and in TensorBoard."""

import threading
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.utils.tensorboard.writer import SummaryWriter

from evimo.errors import BadInput
from evimo.events.stack import SLICES
from evimo.losses.depth import mean_over
from evimo.model.networks import Model
from evimo.recordings.prepared import Prepared
from evimo.training.logs import Log, log_rows
from evimo.training.validation import estimates_masks, middle_events, slice_answered, validated
from evimo.writing import explained, in_utf8

PICTURES = 4  # recordings that are shown, in the middle
SLICES_SCORED = 5  # one slice in so many


class Curves:
    """Loss terms of every step, and the scores of the averaged model on fixed recordings now and then."""

    def __init__(self, recordings: Sequence[Prepared], writer: SummaryWriter, losses: Log, scores: Log) -> None:
        """recordings: to validate on; those shorter than a stack are left out. losses, scores: where numbers go.

        Raises:
            BadInput: none is left.
        """
        self.recordings = [each for each in recordings if len(each) >= SLICES and len(each.event_t)]
        if recordings and not self.recordings:
            raise BadInput(f"no recording to validate on has events and {SLICES} slices", fix="longer ones")
        self._writer, self._losses, self._scores = writer, losses, scores

    def learned(self, step: int, terms: dict[str, float]) -> None:
        """Note the loss terms of a step."""
        self._losses(step, terms)
        self._draw("loss", step, terms)

    def validate(self, step: int, model: Model) -> None:
        """Score a model, and show events, true masks and called masks side by side."""
        scores = validated(model, self.recordings, every=SLICES_SCORED)
        self._scores(step, scores)
        self._draw("validation", step, scores)
        for number, recording in enumerate(self.recordings[:PICTURES]):
            self._writer.add_image(f"masks/{number}", picture(model, recording), step)
        self._writer.flush()

    def _draw(self, group: str, step: int, values: dict[str, float]) -> None:
        for name, value in values.items():
            self._writer.add_scalar(f"{group}/{name}", value, step)


def picture(model: Model, recording: Prepared) -> NDArray[np.uint8]:
    """Events, truth and answer of the middle slice side by side, (1, h, 3 w) uint8, at half the size.

    Masks; of a network that says nothing of what moves, what is near: mean depth is grey, half of it is white.
    """
    batch, answer = slice_answered(model, recording, len(recording) // 2)
    events = (middle_events(batch) / 3).clamp(max=1)
    if estimates_masks(model):
        true, said = batch.moving.float(), ((answer.mixture[:, :1] < 0.5) & (batch.valid > 0)).float()
    else:
        true = _nearness(batch.depth / mean_over(batch.depth, batch.depth_valid), batch.depth_valid)
        said = _nearness(answer.rel_depth, batch.valid > 0)
    panels = torch.cat((events, true, said), dim=-1)
    return (255 * panels[0]).byte().numpy()


def _nearness(rel_depth: Tensor, known: Tensor) -> Tensor:
    """0.5 at the mean depth, 1 at half of it and nearer, 0 where nothing is known."""
    return torch.where(known, 0.5 / rel_depth.clamp(min=0.5), 0)


@contextmanager
def open_curves(out: Path, recordings: Sequence[Prepared], *, step: int) -> Generator[Curves]:
    """The curves of the run in a folder, which go on after a step.

    Raises:
        BadInput: they cannot be written, or the disk is full; or no recording can be scored.
    """
    if in_utf8(str(out)) != str(out):
        raise BadInput(f"the name of {out} is not UTF-8, which TensorBoard needs", fix="another --out")
    with explained(out / "tensorboard"), _said_once():
        writer = SummaryWriter(str(out / "tensorboard"), purge_step=step + 1)
        try:
            with log_rows(out / "log.csv", step) as losses, log_rows(out / "validation.csv", step) as scores:
                yield Curves(recordings, writer, losses, scores)
        finally:
            writer.close()


@contextmanager
def _said_once() -> Generator[None]:
    """Keep TensorBoard's thread from printing why it could not write, as its writer raises the same."""
    usual = threading.excepthook

    def told(failure: threading.ExceptHookArgs, /) -> None:
        if not isinstance(failure.exc_value, OSError):
            usual(failure)

    threading.excepthook = told
    try:
        yield
    finally:
        threading.excepthook = usual
