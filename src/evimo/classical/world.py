"""The motion of the static world in four parameters: shift, expansion and turn of the picture.

Events carried back along the right motion fall onto each other, so the right motion makes their image sharpest. Four
things keep an object that fills a third of the picture from being taken for the world. Events count by the area that
they stand for, not by their number. A second motion is fitted to where the first one sharpens nothing. Of both, and of
a camera at rest, the one wins that makes the largest area sharper. And what does not fit has no say in the last search.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evimo.classical.sharpness import MARGIN, read, sharpest, sharpness, warp_back

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]

COARSE, FINE = (8, 4), (2,)  # px of the picture per pixel of the images of the first searches, and of the last one
COARSE_EVENTS, FINE_EVENTS = 4000, 8000  # at most that many take part
SPREAD = np.array([20.0, 20.0, 2.0, 2.0])  # px of an image per slice by which a search may end from its start
CELL = 16  # px of the picture, of the cells that stand for areas
CROWDED = 0.3  # of a cell's mean count: from about there on, more events count no more
FEWEST = 3  # events of a cell that has a say
SERVED = 0.05  # log of how much sharper a motion makes the cells that it serves
ELSEWHERE = 0.15  # weight of their events in the second search
MOST_SAY = 0.1  # of a cell, in logs of sharpness
REST = 0.01  # mean say up to which the camera rests


@dataclass(frozen=True, slots=True)
class Scene:
    """The events of a window about a slice's centre.

    x, y: (N,) float32 px; t: (N,) float32, slices since the centre.
    size: (height, width) of the picture; centre: (x, y) about which it expands and turns.
    """

    x: F4
    y: F4
    t: F4
    size: tuple[int, int]
    centre: tuple[float, float]

    def thinned(self, most: int) -> "Scene":
        """The same with at most so many of the events, evenly chosen."""
        step = max(1, -(-len(self.t) // most))
        return Scene(self.x[::step], self.y[::step], self.t[::step], self.size, self.centre)


def coarse_motion(scene: Scene) -> F8 | None:
    """Return about the motion (4,) of the static world, as in `sharpness`; None where the camera seems to rest."""
    scene = scene.thinned(COARSE_EVENTS)
    cells, resting = _Cells(scene), np.zeros(4)
    first = searched(scene, cells.weight, resting, steps=COARSE)
    before, after = cells.sharpness(resting), cells.sharpness(first)
    served = np.log((after + 1) / (before + 1)) > SERVED
    weight = cells.weight * np.where(served, ELSEWHERE, 1).astype(np.float32)[cells.of]
    second = searched(scene, weight, resting, steps=COARSE)
    says = [cells.say(before, each) for each in (after, cells.sharpness(second))]
    if max(says) <= REST:
        return None
    return first if says[0] >= says[1] else second


def fine_motion(scene: Scene, share: F4, start: F8) -> F8:
    """Return the motion near `start` that makes the events sharpest, each counting by its share (N,)."""
    return searched(scene, _Cells(scene).weight * share, start, steps=FINE)


def searched(scene: Scene, weight: F4, start: F8, *, steps: tuple[int, ...]) -> F8:
    """Return the motion near `start` that makes weighted events sharpest, in images of coarser, then finer pixels."""
    motion = start
    for step in steps:
        x, y, images, centre = _at_scale(scene, step)
        scale = _scale(step)
        motion = sharpest(x, y, scene.t, weight, motion * scale, centre, SPREAD, images) / scale
    return motion


class _Cells:
    """The picture in cells. of: (N,) each event's cell; count: of events in each; weight: (N,) of the events."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        across = scene.size[1] // CELL + 1
        row, column = ((each + np.float32(0.5)).astype(np.intp) // CELL for each in (scene.y, scene.x))
        self.of = row * across + column
        self.count = np.bincount(self.of, minlength=(scene.size[0] // CELL + 1) * across)
        mean = max(1.0, len(self.of) / max(1, int(np.count_nonzero(self.count))))
        self.weight = (1 / (self.count / mean + CROWDED)).astype(np.float32)[self.of]

    def sharpness(self, motion: F8) -> F8:
        """How closely the events of each cell lie together along a motion."""
        x, y, images, centre = _at_scale(self._scene, FINE[0])
        at, close = np.empty((2, len(x)), np.float32), np.empty(len(x), np.float32)
        warp_back(x, y, self._scene.t, motion * _scale(FINE[0]), centre, at)
        sharpness(at, np.ones(len(x), np.float32), images)
        read(at, images[2], close)
        return np.bincount(self.of, close, len(self.count)).astype(np.float64)

    def say(self, before: F8, after: F8) -> float:
        """How much sharper the mean cell has become, in bounded logs."""
        asked = self.count >= FEWEST
        logs = np.log((after[asked] + 1) / (before[asked] + 1))
        return float(np.clip(logs, -MOST_SAY, MOST_SAY).mean()) if len(logs) else 0.0


def _scale(step: int) -> F8:
    """What motions are multiplied by in pixels `step` times as large; speeds at `ARM` of them stay as they are."""
    return np.array([1 / step, 1 / step, 1.0, 1.0])


def _at_scale(scene: Scene, step: int) -> tuple[F4, F4, F4, tuple[float, float]]:
    """Events in pixels `step` times as large, room for images of them, and the centre there."""
    half, scale = np.float32(0.5), np.float32(1 / step)
    height, width = (-(-side // step) + 2 * MARGIN for side in scene.size)
    centre = (scene.centre[0] + 0.5) / step - 0.5, (scene.centre[1] + 0.5) / step - 0.5
    images = np.zeros((3, height, width), np.float32)
    return (scene.x + half) * scale - half, (scene.y + half) * scale - half, images, centre
