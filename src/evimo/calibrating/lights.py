"""Lights in an image: compact bright spots, and which of them are those of a wand."""

from itertools import combinations, permutations

import cv2
import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadInput

F8 = NDArray[np.float64]

BRIGHT = 100 / 255  # of the brightest that a pixel may be; strobes of mocap's own cameras are dimmer rings
AREAS = (5, 400)  # px
SLENDER = 2.5  # times as long as wide, and 2 px
FILLED = 0.5  # of its box; a ring fills less
MOST_SPOTS = 25  # an image with more shows something else as well
STRAIGHT_M = 0.005  # lights this close to the line through two others lie on it
STRAIGHT_PX, STRAIGHT = 1.0, 0.02  # in the image: this, and this share of the line's length
SHORTEST_PX = 20.0
PERSPECTIVE = 0.1  # how much a slanted line changes where along it the middle light is


def find_spots(image: NDArray[np.generic], *, brightest: float = 255) -> F8:
    """Centres (N, 2) of the compact bright spots of an image (H, W), px; x first, whole numbers at pixel centres.

    Args:
        image: brightness, or counts of events.
        brightest: what counts as full brightness.
    """
    values = np.asarray(image, np.float64)
    count, labels, boxes, _ = cv2.connectedComponentsWithStats((values > BRIGHT * brightest).astype(np.uint8))
    width, height, area = (boxes[:, at] for at in (cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT, cv2.CC_STAT_AREA))
    long, short = np.maximum(width, height), np.minimum(width, height)
    fits = (area >= AREAS[0]) & (area <= AREAS[1]) & (long <= SLENDER * short + 2) & (area >= FILLED * width * height)
    fits[0] = False  # the background
    weight = np.bincount(labels.ravel(), values.ravel(), minlength=count)
    rows, columns = np.indices(values.shape)
    sums = [np.bincount(labels.ravel(), (at * values).ravel(), minlength=count) for at in (columns, rows)]
    return np.stack(sums, axis=1)[fits] / weight[fits, None]


class WandPattern:
    """Lights of a wand on two lines that share a light, as a T or an L, which makes them recognisable in an image."""

    def __init__(self, points: F8) -> None:
        """Find the lines.

        Args:
            points: (K, 3), m, in any axes.

        Raises:
            BadInput: there are no two such lines.
        """
        lines = [line for line in combinations(range(len(points)), 3) if _off_line(points[list(line)]) < STRAIGHT_M]
        pairs = [(one, two) for one, two in combinations(lines, 2) if len(set(one) & set(two)) == 1]
        if not pairs:
            raise BadInput(
                "the wand's lights cannot be told apart: they must lie on two lines of three that share one",
                fix="a wand as a T or an L, or a board",
            )
        self.points = points
        self.lines = [_in_order(points, line) for line in pairs[0]]

    def labels(self, spots: F8) -> list[tuple[dict[int, int], float]]:
        """Ways to read spots (N, 2) as the lights: which spot each light is, and how badly that fits, best first."""
        if not len(spots) or len(spots) > MOST_SPOTS:
            return []
        first, second = (self._on_line(spots, line) for line in self.lines)
        found: list[tuple[dict[int, int], float]] = []
        for one, misfit in first:
            for other, more in second:
                together = one | other
                agree = all(other[light] == spot for light, spot in one.items() if light in other)
                if agree and len(set(together.values())) == len(together):
                    found.append((together, misfit + more))
        return sorted(found, key=lambda each: each[1])

    def _on_line(self, spots: F8, line: tuple[int, int, int]) -> list[tuple[dict[int, int], float]]:
        """Triples of spots that may be the three lights of a line."""
        if len(spots) < 3:
            return []
        lengths = np.linalg.norm(self.points[list(line)] - self.points[line[0]], axis=1)
        triples = np.array(list(permutations(range(len(spots)), 3)))
        start, middle, stop = (spots[triples[:, at]] for at in range(3))
        length = np.linalg.norm(stop - start, axis=1)
        way = (stop - start) / np.maximum(length, 1e-9)[:, None]
        along = ((middle - start) * way).sum(axis=1) / np.maximum(length, 1e-9)
        off = np.abs(way[:, 0] * (middle - start)[:, 1] - way[:, 1] * (middle - start)[:, 0])
        share = np.abs(along - lengths[1] / lengths[2])
        fits = (length > SHORTEST_PX) & (off < STRAIGHT_PX + STRAIGHT * length) & (share < PERSPECTIVE)
        misfit = share + 5 * off / np.maximum(length, 1e-9)
        return [
            (dict(zip(line, map(int, triple), strict=True)), float(much))
            for triple, much in zip(triples[fits], misfit[fits], strict=True)
        ]


def _off_line(three: F8) -> float:
    """How far the middle one of three points lies from the line through the outer ones, m."""
    start, middle, stop = three[list(_in_order(three, (0, 1, 2)))]
    along = (stop - start) / np.linalg.norm(stop - start)
    return float(np.linalg.norm(np.cross(along, middle - start)))


def _in_order(points: F8, line: tuple[int, int, int]) -> tuple[int, int, int]:
    """The three with the middle one in the middle."""
    ends = max(combinations(line, 2), key=lambda pair: float(np.linalg.norm(points[pair[0]] - points[pair[1]])))
    (middle,) = set(line) - set(ends)
    return ends[0], middle, ends[1]
