"""The worst masks of a model as pictures: what fired, what moved, and what was said of it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from evimo.benchmark.cases import Rival, Sequence
from evimo.benchmark.tally import FrameScore, Tally
from evimo.errors import BadInput
from evimo.evaluation.labels import LabelledSlice
from evimo.evaluation.scoring import labelled_estimates
from evimo.events.slices import SLICE_US
from evimo.recordings.prediction import Prediction
from evimo.streaming.pipeline import run
from evimo.viewing.colours import BACKDROP, NEGATIVE, OBJECTS, POSITIVE, RGB, Image, id_table, painted
from evimo.viewing.maps import Zoom, event_levels, grey_table, hatch, hatched, polarity_table, tinted

HIT: RGB = OBJECTS[3]
MISSED: RGB = POSITIVE
FALSE: RGB = NEGATIVE
GAP = 6  # px between panels
MOST = 6


@dataclass(frozen=True, slots=True)
class WorstCase:
    """The worst slice of one sequence. picture: events, truth and prediction beside each other."""

    sequence: str
    frame: FrameScore
    picture: Image


def worst_cases(
    rival: Rival, sequences: Iterable[Sequence], tallies: Mapping[str, Tally], *, most: int = MOST
) -> list[WorstCase]:
    """Of each sequence its slice with the lowest IoU, where equal the one with more wrong pixels; the worst of them.

    tallies: of the model, by the sequence's name.
    """
    found: list[tuple[float, int, Sequence, FrameScore]] = []
    for sequence in sequences:
        if frames := tallies[sequence.name].frames:
            worst = min(frames, key=lambda frame: (frame.iou, -frame.wrong_px))
            found.append((worst.iou, -worst.wrong_px, sequence, worst))
    found.sort(key=lambda each: each[:2])
    return [WorstCase(sequence.name, frame, _drawn(rival, sequence, frame)) for *_, sequence, frame in found[:most]]


def _drawn(rival: Rival, sequence: Sequence, frame: FrameScore) -> Image:
    """The picture of one slice, estimated once more."""
    recording = sequence.recording
    since_us = frame.start_us - recording.events.start_us
    estimates = run(
        recording.events,
        model=rival.model,
        camera=recording.camera,
        start_s=max(since_us, 0) / 1e6,
        stop_s=(since_us + SLICE_US) / 1e6,
        imu="off",
    )
    for prediction, sample in labelled_estimates(recording, estimates):
        if sample is not None:
            return panels(prediction, sample)
    raise BadInput(f"{recording.path} has no slice at {frame.start_us} µs", fix="an --out of its own for each --data")


def panels(prediction: Prediction, sample: LabelledSlice) -> Image:
    """Events, true movers, and the mask: right where it hits, missed, and false."""
    size = sample.scored.shape
    zoom = Zoom(sensor=(size[0], size[1]), shown=(size[0], size[1]))
    levels = event_levels(sample.events, zoom)
    events = painted(levels, polarity_table())
    truth, said = (painted(levels, grey_table(190)) for _ in range(2))
    moving = sample.moving & sample.scored
    tinted(truth, painted(np.where(moving, sample.truth.ids, 0).astype(np.uint8), id_table()), moving)
    called = (np.zeros_like(moving) if prediction.moving is None else prediction.moving) & sample.scored
    for mask, colour in ((called & moving, HIT), (moving & ~called, MISSED), (called & ~moving, FALSE)):
        tinted(said, np.full_like(said, colour), mask)
    for panel in (events, truth, said):
        hatched(panel, hatch(size), unknown=~sample.scored)
    gap = np.full((size[0], GAP, 3), BACKDROP, np.uint8)
    return np.concatenate([events, gap, truth, gap, said], axis=1)


def as_png(picture: Image) -> bytes:
    """An RGB picture as the bytes of a PNG file."""
    coded: tuple[bool, NDArray[np.uint8]] = cv2.imencode(".png", picture[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9])
    return coded[1].tobytes()
