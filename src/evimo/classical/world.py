"""The motion of the static world in four parameters: shift, expansion and turn of the picture.

Events carried back along the right motion fall onto each other, so the right motion makes their image sharpest. Four
things keep an object that fills a third of the picture from being taken for the world. Crowded places are thinned, so
that events count by the area that they stand for. A second motion is fitted to where the first one sharpens nothing. Of
both the one wins that makes the larger area sharper. And what does not fit has little say in the last search.

Last, the camera rests unless the motion that was found fits much of the picture. A slow one hardly sharpens: the smear
that it removes grows with the square of its speed. Its opposite blurs twice as far, so that places are asked which of
the two fits them better: an object's few places, noise, and a picture that rests have no answer in common.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evimo.classical.sharpness import MARGIN, read, sharpest, sharpness, warp_back

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]

COARSE, FINE = (8, 4), (2,)  # px of the picture per pixel of the images of the first searches, and of the last one
COARSE_EVENTS, FINE_EVENTS = 3000, 7000  # at most that many take part
SPREAD = np.array([20.0, 20.0, 2.0, 2.0])  # px of an image per slice by which a first search may end from its start
FREE = 10 * SPREAD  # and the last one: pulled to its start, it would find too little expansion and turn
CELL = 16  # px of the picture, of the cells that stand for areas
CROWDED = 0.3  # of a cell's mean count: from about there on, more events count no more
FEWEST = 3  # events of a cell that has a say
CALM = 6.0  # added to the sharpness of a cell, so that few events say little
SERVED = 0.03  # log of how much sharper a motion makes the cells that it serves
ELSEWHERE = 0.15  # weight of their events in the second search
MOST_SAY = 0.1  # of a cell, in logs of sharpness
VOTE = 1  # px of the picture per pixel of the images that a motion is told from its opposite by
WHOLE_VOTE = 0.02  # log of how much sharper one of them makes a cell, from which on it has no more say


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

    def cells(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Each event's cell, (N,), and how many events each cell holds."""
        across = self.size[1] // CELL + 1
        row, column = (((each + np.float32(0.5)) * np.float32(1 / CELL)).astype(np.intp) for each in (self.y, self.x))
        of = row * across + column
        return of, np.bincount(of, minlength=(self.size[0] // CELL + 1) * across)

    def thinned(self, most: int) -> "Scene":
        """The same with about `most` of the events, at most: all of calm cells, evenly chosen ones of crowded cells."""
        if len(self.t) <= most:
            return self
        of, count = self.cells()
        ordered = np.sort(count)
        room = (most - np.cumsum(ordered) + ordered) / np.arange(len(ordered), 0, -1)  # for each of the fuller cells
        kept = room[np.argmax(room < ordered)]
        chosen = np.flatnonzero(np.diff(np.floor(np.cumsum((kept / np.maximum(count, kept))[of])), prepend=0) > 0)
        return Scene(self.x[chosen], self.y[chosen], self.t[chosen], self.size, self.centre)


def coarse_motion(scene: Scene) -> F8:
    """Return about the motion (4,) of the static world, as in `sharpness`, if the camera does not rest."""
    few, cells, resting = scene.thinned(COARSE_EVENTS), _Cells(scene), np.zeros(4)
    searching = _Cells(few)
    before = cells.sharpness(resting)
    first = searched(few, searching.weight, resting, steps=COARSE)
    by_first = np.log(cells.sharpness(first) / before)
    weight = searching.weight * np.where(by_first > SERVED, ELSEWHERE, 1).astype(np.float32)[searching.of]
    second = searched(few, weight, resting, steps=COARSE)
    by_second = np.log(cells.sharpness(second) / before)
    return first if cells.say(by_first, by_second) >= cells.say(by_second, by_first) else second


def fine_motion(scene: Scene, share: F4, start: F8) -> F8:
    """Return the motion near `start` that makes the events sharpest, each counting by its share (N,)."""
    return searched(scene, _Cells(scene).weight * share, start, steps=FINE, spread=FREE)


def shared(scene: Scene, motion: F8) -> float:
    """Return the share of the picture that follows a motion rather than its opposite, less that which does not.

    Of an object before a camera at rest it is small, whatever events there are elsewhere.
    """
    cells = _Cells(scene)
    says = np.log(cells.sharpness(motion, step=VOTE) / cells.sharpness(-motion, step=VOTE))
    votes = np.clip(says[cells.count >= FEWEST] / WHOLE_VOTE, -1, 1)
    return float(votes.sum()) / len(cells.count)


def searched(scene: Scene, weight: F4, start: F8, *, steps: tuple[int, ...], spread: F8 = SPREAD) -> F8:
    """Return the motion near `start` that makes weighted events sharpest, in images of coarser, then finer pixels."""
    motion = start
    for step in steps:
        x, y, images, centre = _at_scale(scene, step)
        scale = _scale(step)
        motion = sharpest(x, y, scene.t, weight, motion * scale, centre, spread, images) / scale
    return motion


class _Cells:
    """The picture in cells. of: (N,) each event's cell; count: of events in each; weight: (N,) of the events."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self.of, self.count = scene.cells()
        mean = max(1.0, len(self.of) / max(1, int(np.count_nonzero(self.count))))
        self.weight = (1 / (self.count / mean + CROWDED)).astype(np.float32)[self.of]

    def sharpness(self, motion: F8, *, step: int = FINE[0]) -> F8:
        """How closely the events of each cell lie together along a motion, in pixels of that size; never 0."""
        x, y, images, centre = _at_scale(self._scene, step)
        at, close = np.empty((2, len(x)), np.float32), np.empty(len(x), np.float32)
        warp_back(x, y, self._scene.t, motion * _scale(step), centre, at)
        sharpness(at, np.ones(len(x), np.float32), images)
        read(at, images[2], close)
        return np.bincount(self.of, close, len(self.count)).astype(np.float64) + CALM

    def say(self, sharper: F8, by_other: F8) -> float:
        """How much sharper, in bounded logs, a motion makes all cells; those that only the other serves count 0."""
        own = (self.count >= FEWEST) & ~((sharper < 0) & (by_other > SERVED))
        return float(np.clip(sharper[own], -MOST_SAY, MOST_SAY).sum())


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
