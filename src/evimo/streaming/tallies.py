# pyright: basic
"""One compiled pass each over an image of labels: how much of what lies where."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evimo.compiling import njit

LABELS = 256  # of a byte; 0 is the background, and is not counted
F8 = NDArray[np.float64]
I8 = NDArray[np.int64]


class Extents(NamedTuple):
    """Of each label 0...255: area_px, first and last column and row, and sums of columns and rows, (256,) int64."""

    area_px: I8
    x0: I8
    y0: I8
    x1: I8
    y1: I8
    sum_x: I8
    sum_y: I8


@njit(nogil=True)
def extents(labels):
    """The `Extents` of an image of labels (h, w) uint8."""
    area, sum_x, sum_y = np.zeros(LABELS, np.int64), np.zeros(LABELS, np.int64), np.zeros(LABELS, np.int64)
    x0, y0 = np.full(LABELS, labels.shape[1], np.int64), np.full(LABELS, labels.shape[0], np.int64)
    x1, y1 = np.full(LABELS, -1, np.int64), np.full(LABELS, -1, np.int64)
    for y in range(labels.shape[0]):
        for x in range(labels.shape[1]):
            k = labels[y, x]
            if k:
                area[k] += 1
                sum_x[k] += x
                sum_y[k] += y
                x0[k], x1[k] = min(x0[k], x), max(x1[k], x)
                y0[k], y1[k] = min(y0[k], y), y
    return Extents(area, x0, y0, x1, y1, sum_x, sum_y)


@njit(nogil=True)
def weighted_sums(labels, weights, values):
    """Of each label: the sum of weights (256,), and of weights times values (256, 3) and their squares (256,).

    Args:
        labels: (h, w) uint8.
        weights: (h, w) float32.
        values: (3, h, w) float32.
    """
    weight, first, second = np.zeros(LABELS), np.zeros((LABELS, 3)), np.zeros(LABELS)
    for y in range(labels.shape[0]):
        for x in range(labels.shape[1]):
            k = labels[y, x]
            if k:
                w = np.float64(weights[y, x])
                weight[k] += w
                for axis in range(3):
                    value = np.float64(values[axis, y, x])
                    first[k, axis] += w * value
                    second[k] += w * value * value
    return weight, first, second


@njit(nogil=True)
def shared_pixels(labels, others):
    """How many pixels each pair of labels shares, (256, 256) int64; background counts here."""
    shared = np.zeros((LABELS, LABELS), np.int64)
    for y in range(labels.shape[0]):
        for x in range(labels.shape[1]):
            shared[labels[y, x], others[y, x]] += 1
    return shared
