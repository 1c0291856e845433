"""What a calibration leaves: arrows over the sensor from where points should be to where they were, and a curve."""

import cv2
import numpy as np
from numpy.typing import NDArray

from evimo.viewing.charts import Axis, Curve, draw_curves
from evimo.viewing.colours import BACKDROP, CARD, NEGATIVE, OBJECTS, POSITIVE, Image
from evimo.viewing.layout import Box
from evimo.viewing.strokes import SMALL, TITLE, write

F8 = NDArray[np.float64]

PANEL = (520, 640)
GAP, TOP = 12, 40
MAGNIFIED = 10.0


def draw_residuals(px: F8, errors_px: F8, kept: NDArray[np.bool_], *, size: tuple[int, int]) -> Image:
    """A picture of errors (N, 2) of points found at px (N, 2): where they are on the sensor, and how large.

    Args:
        px: x first.
        errors_px: found minus expected.
        kept: (N,): those that took part; the others are drawn in another colour.
        size: height and width of the sensor.
    """
    height, width = PANEL
    image = np.full((height + 2 * GAP, 2 * width + 3 * GAP, 3), BACKDROP, np.uint8)
    _arrows(image, Box(GAP, GAP, width, height), px, errors_px, kept, size)
    length = np.sort(np.linalg.norm(errors_px[kept], axis=1))
    most = max(float(length[-1]) if len(length) else 1.0, 1e-3)
    tick = 10 ** np.floor(np.log10(most))
    ticks = tuple(float(each) for each in np.arange(0, most + tick / 2, tick if most / tick > 2 else tick / 5))
    axes = Axis("error of a point, px", 0, most, ticks), Axis("", 0, 1, (0, 0.25, 0.5, 0.75, 1))
    share = (np.arange(len(length)) + 1) / max(len(length), 1)
    curves = [Curve(f"share of {len(length)} points", length, share, POSITIVE)]
    draw_curves(image, Box(2 * GAP + width, GAP, width, height), "Errors", axes=axes, curves=curves)
    return image


def _arrows(image: Image, box: Box, px: F8, errors_px: F8, kept: NDArray[np.bool_], size: tuple[int, int]) -> None:
    box.of(image)[:] = CARD
    title = f"Found minus expected, {MAGNIFIED:g} times as long"
    write(image, title, (box.x + 14, box.y + 20), size=TITLE, bold=True)
    scale = min((box.width - 2 * GAP) / size[1], (box.height - TOP - GAP) / size[0])
    left, top = box.x + (box.width - scale * size[1]) / 2, box.y + TOP
    corner = (round(left + scale * size[1]), round(top + scale * size[0]))
    cv2.rectangle(image, (round(left), round(top)), corner, BACKDROP, -1)
    start = np.rint((px + 0.5) * scale + (left, top)).astype(int)
    ends = (px + 0.5 + MAGNIFIED * np.nan_to_num(errors_px)) * scale + (left, top)
    stop = np.rint(np.clip(ends, (left, top), corner)).astype(int)
    for at in np.flatnonzero(np.isfinite(errors_px).all(axis=1)):
        colour = NEGATIVE if kept[at] else OBJECTS[0]
        cv2.line(image, tuple(map(int, start[at])), tuple(map(int, stop[at])), colour, 1, cv2.LINE_AA)
        cv2.circle(image, tuple(map(int, start[at])), 2, colour, -1, cv2.LINE_AA)
    write(image, f"{int((~kept).sum())} left out", (box.right - 14, box.y + 20), size=SMALL, align="right")
