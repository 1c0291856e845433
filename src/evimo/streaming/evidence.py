"""What the networks see of a stack of slices, made outside their graph: `model/evidence.py` compiled for the CPU.

Each slice is prepared once and then serves the five stacks it is part of.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evimo.streaming.local_motion import (
    blurred,
    directional_trust,
    gaussian,
    halved,
    local_motion,
    pooled_products,
    trust,
    warped,
)

F4 = NDArray[np.float32]

HALF = 2  # frames pixels per pixel of the networks
EVIDENCE = 22  # channels: five candidates of two components, nine of trust, three of trust by direction
FASTEST_PX = 6.0  # as in model/evidence.py
_SHARP = gaussian(0.7)


class SliceImages(NamedTuple):
    """One slice as the networks and the evidence see it.

    image:  (3, h, w) log counts of both polarities and mean time, at half the frame's size.
    smooth: (2, h, w) the log counts, blurred.
    coarse: (2, a, b) log counts of the evidence's grid, blurred.
    """

    image: F4
    smooth: F4
    coarse: F4


class EvidenceMaker:
    """Images and evidence for networks with a given `stride` and `reduction` (see `ModelConfig`)."""

    def __init__(self, size: tuple[int, int], *, stride: int, reduction: int) -> None:
        """For frames of one size (height, width)."""
        self.reduction = reduction
        self.size = halved_size(size, stride)
        self.cells = tuple(side // reduction for side in self.size)
        self._windows = [gaussian(sigma / reduction) for sigma in (8.0, 5.0, 4.0)]

    def images(self, frame: F4) -> SliceImages:
        """One event frame (3, H, W), prepared."""
        image, coarse = np.empty((3, *self.size), np.float32), np.empty((2, *self.cells), np.float32)
        halved(frame, self.reduction, image, coarse)
        return SliceImages(image, blurred(image[:2], _SHARP), blurred(coarse, _SHARP))

    def nothing(self) -> SliceImages:
        """A slice without events."""
        shapes = (3, *self.size), (2, *self.size), (2, *self.cells)
        return SliceImages(*(np.zeros(shape, np.float32) for shape in shapes))

    def image(self, stack: Sequence[SliceImages]) -> F4:
        """What the networks' graph calls `image` (15, h, w): all counts, then all times."""
        counts = [part.image[:2] for part in stack]
        return np.concatenate([*counts, *(part.image[2:] for part in stack)])

    def evidence(self, stack: Sequence[SliceImages]) -> F4:
        """Evidence (22, a, b) of five slices about the middle one: motion, trust and trust by direction, in turn."""
        first, before, here, after, last = (part.smooth for part in stack)
        large, wide, narrow = self._windows
        near = self._products(before, here, after)
        longer = near + self._products(first, before, here) + self._products(here, after, last)
        longer += self._products(first, here, last, slices=4.0)
        small = blurred(near, _SHARP)
        at_large = local_motion(blurred(near, large))
        coarse = pooled_products(stack[1].coarse, stack[2].coarse, stack[3].coarse, 2.0, 1)
        at_coarse = self.reduction * local_motion(blurred(coarse, gaussian(4.0)))
        found = np.empty((EVIDENCE, *near.shape[1:]), np.float32)
        found[0:2], found[2:4], found[4:6] = local_motion(small), at_large, local_motion(blurred(longer, wide))
        trust(small, found[10:13])
        directional_trust(small, found[19:22])
        for number, guess in enumerate((at_large, at_coarse)):
            start = _bounded(guess)
            moved = warped(before, after, blurred(start, _SHARP), self.reduction)
            left = blurred(self._products(moved[0], here, moved[1]), narrow)
            found[6 + 2 * number : 8 + 2 * number] = start + _bounded(local_motion(left))
            trust(left, found[13 + 3 * number : 16 + 3 * number])
        return found

    def _products(self, before: F4, here: F4, after: F4, *, slices: float = 2.0) -> F4:
        return pooled_products(before, here, after, slices, self.reduction)


def halved_size(size: tuple[int, int], stride: int) -> tuple[int, int]:
    """Half of (height, width) after both were enlarged to multiples of the stride."""
    return -(-size[0] // stride) * stride // HALF, -(-size[1] // stride) * stride // HALF


def halved_mask(mask: NDArray[np.bool_], *, stride: int) -> F4:
    """The share of each pixel's four that a mask (H, W) holds, (h, w); beyond the mask is nothing."""
    height, width = halved_size(mask.shape, stride)
    whole = np.zeros((HALF * height, HALF * width), np.float32)
    whole[: mask.shape[0], : mask.shape[1]] = mask
    return whole.reshape(height, HALF, width, HALF).mean((1, 3))


def _bounded(motion: F4) -> F4:
    return np.clip(motion, -FASTEST_PX, FASTEST_PX, dtype=np.float32)
