# pyright: basic
"""What three slices in a row agree on: a mask in which the neighbours, brought along by the flow, have their say.

An object that rests for a moment, or shows few events, is missed in one slice and seen in the next. Mistakes of three
answers are far from the same, so their mean, in log odds, is better than any of them. More neighbours help calm scenes
and hurt difficult ones (docs/decisions/0008-neighbours-agree.md).
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from evimo.compiling import njit
from evimo.geometry.rectification import Rectification
from evimo.streaming.inference import Answer
from evimo.streaming.looks import HALF
from evimo.streaming.rotation import SLICE_S

F4 = NDArray[np.float32]

SAY = 0.6  # of a neighbour, where the slice itself has 1
SURE = 1e-3  # no answer is taken to be surer than that
VETO = 2.0  # in log odds: a neighbour says "nothing moves" no louder, since a wrong flow may have led elsewhere


class Agreement:
    """Gives each slice's mask what its two neighbours say of the same places; made once per camera."""

    def __init__(self, rectification: Rectification) -> None:
        image = rectification.image
        per_slice = np.array((image.fx, image.fy), np.float32) * np.float32(SLICE_S / HALF)
        self._px_per_slice: F4 = per_slice[:, None, None]
        self._size = tuple(-(-side // HALF) for side in image.size)

    def of(self, row: Sequence[Answer | None]) -> Answer:
        """Return the middle one of three answers, its mask agreed on with the neighbours that there are.

        One without a mask stays so. All without the margin behind the image, where nothing moves and which would have
        a say at the edge.
        """
        before, here, after = (each and each.cropped(*self._size) for each in row)
        if here is None:
            raise ValueError("the middle one of three answers is missing")
        if here.moving is None:
            return here
        flow = np.nan_to_num(here.flow * self._px_per_slice)  # no number is no place to read at
        total, weight = _log_odds(here.moving), 1.0
        for neighbour, towards in ((before, -1), (after, 1)):
            if neighbour is not None and neighbour.moving is not None:
                said = np.maximum(_log_odds(neighbour.moving), np.float32(-VETO))
                _add_along(said, flow, np.float32(towards), np.float32(SAY), total)
                weight += SAY
        return here._replace(moving=1 / (1 + np.exp(total / np.float32(-weight))))


def _log_odds(probability: F4) -> F4:
    """Of a probability; what is no number says nothing."""
    kept = np.clip(np.nan_to_num(probability, nan=0.5), SURE, 1 - SURE)
    return np.log(kept / (1 - kept))


@njit(nogil=True, fastmath=True)
def _add_along(image, flow, towards, say, total):
    """Add what an image (h, w) holds where each pixel's flow (2, h, w), times `towards`, leads; the border holds on."""
    height, width = image.shape
    for row in range(height):
        for column in range(width):
            x = min(max(np.float32(column) + towards * flow[0, row, column], np.float32(0)), np.float32(width - 1))
            y = min(max(np.float32(row) + towards * flow[1, row, column], np.float32(0)), np.float32(height - 1))
            left, top = int(x), int(y)
            right, below = min(left + 1, width - 1), min(top + 1, height - 1)
            ax, ay = x - np.float32(left), y - np.float32(top)
            upper = image[top, left] + ax * (image[top, right] - image[top, left])
            lower = image[below, left] + ax * (image[below, right] - image[below, left])
            total[row, column] += say * (upper + ay * (lower - upper))
