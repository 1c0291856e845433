"""The trivial answers: what a model must beat before its own scores mean anything (docs: learnability)."""

from collections.abc import Iterable, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from evimo.evaluation.labels import LabelledSlice
from evimo.evaluation.pixel_classes import PixelClasses
from evimo.evaluation.ratios import Scores, added
from evimo.evaluation.scores import (
    depth_scores,
    flow_scores,
    mask_scores,
    object_scores,
    twist_scores,
)
from evimo.events.events import Events
from evimo.recordings.prediction import Prediction

BOXES_PER_WIDTH = 13  # about an object; from 10 to 25 the score changes by 3 % on simulated recordings
THRESHOLDS: tuple[float, ...] = tuple(round(float(each), 3) for each in np.geomspace(0.7, 10, 24))
DENSITY_THRESHOLD = 2.5
"""Times the mean density of the frame: within 0.002 of the best IoU on replicas of 0.4 minutes at 173x130 with seeds
1000 and 2000, by `python bench/populations.py REPLICA`."""

ALL_BACKGROUND = "all background"
EVERYTHING = "everything moves"
DENSITY = "event density, tuned elsewhere"
DENSITY_ORACLE = "event density, oracle threshold"
CONSTANT_DEPTH = "one depth everywhere"
ZERO_FLOW = "zero flow"
ZERO_TWIST = "zero twist"
ROWS = (ALL_BACKGROUND, EVERYTHING, DENSITY, CONSTANT_DEPTH, ZERO_FLOW, ZERO_TWIST)
"""In the order of the tables."""


def event_density(events: Events, size: tuple[int, int]) -> NDArray[np.float32]:
    """(H, W) events in the box around each pixel over the mean of all pixels: 1 is average, all 0 without events.

    The box is 1/13 of the width; at the border its mean is over the pixels inside the image. Relative to the frame,
    because how many events a sensor fires varies tenfold: that makes it the stronger baseline.
    """
    height, width = size
    count = np.bincount(events.y.astype(np.int64) * width + events.x, minlength=height * width)
    side = width // BOXES_PER_WIDTH | 1  # odd
    inside = cv2.blur(np.ones(size, np.float32), (side, side), borderType=cv2.BORDER_CONSTANT)
    density = cv2.blur(count.reshape(size).astype(np.float32), (side, side), borderType=cv2.BORDER_CONSTANT) / inside
    return (density / max(len(events) / (height * width), 1e-9)).astype(np.float32)


def density_scores(sample: LabelledSlice, thresholds: Sequence[float]) -> dict[float, Scores]:
    """Mask scores of "moving is where the event density exceeds the threshold", for each threshold."""
    density = event_density(sample.events, sample.scored.shape)
    classes = PixelClasses(sample)
    return {threshold: mask_scores(density > threshold, sample, classes) for threshold in thresholds}


def best_threshold(scores: dict[float, Scores], *, by: str = "iou") -> float:
    """The threshold with the highest score of that name; the lowest threshold where nothing was scored."""

    def score_of(threshold: float) -> float:
        score = scores[threshold].get(by)
        return (score.value or 0.0) if score else 0.0

    return max(sorted(scores), key=score_of)


def threshold_scores(samples: Iterable[LabelledSlice]) -> dict[float, Scores]:
    """Mask scores of each of `THRESHOLDS` over many slices."""
    totals: dict[float, Scores] = {threshold: {} for threshold in THRESHOLDS}
    for sample in samples:
        totals = {key: added((totals[key], scores)) for key, scores in density_scores(sample, THRESHOLDS).items()}
    return totals


def tune_density_threshold(samples: Iterable[LabelledSlice], *, by: str = "iou") -> float:
    """The best of `THRESHOLDS` on these slices, which must not be the ones evaluated: that would be an oracle."""
    return best_threshold(threshold_scores(samples), by=by)


def masks(sample: LabelledSlice, density_threshold: float) -> dict[str, Prediction]:
    """The trivial answers that are masks, by the name of the row; densities beyond twice the threshold are sure."""
    density = event_density(sample.events, sample.scored.shape)
    return {
        EVERYTHING: Prediction(moving=np.ones(sample.scored.shape, np.bool_)),
        DENSITY: Prediction(
            moving=density > density_threshold, probability=np.clip(density / (2 * density_threshold), 0, 1)
        ),
    }


def trivial_scores(sample: LabelledSlice) -> dict[str, Scores]:
    """Scores of every answer that looks at no event, by the name of its row."""
    nothing = np.zeros(sample.scored.shape, np.bool_)
    standing = np.zeros((*sample.scored.shape, 3))
    classes = PixelClasses(sample)
    return {
        ALL_BACKGROUND: mask_scores(nothing, sample, classes),
        EVERYTHING: mask_scores(~nothing, sample, classes),
        CONSTANT_DEPTH: depth_scores(np.ones(sample.scored.shape), sample),
        ZERO_FLOW: flow_scores(np.zeros((2, *sample.scored.shape)), sample),
        ZERO_TWIST: twist_scores(np.zeros(6), sample, metres=1.0) | object_scores(standing, sample, metres=1.0),
    }
