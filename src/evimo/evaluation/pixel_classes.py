"""What is true of each pixel of a slice, as one number, so that a mask is compared with all of it by one count."""

import numpy as np
from numpy.typing import NDArray

from evimo.evaluation.labels import LabelledSlice
from evimo.evaluation.metrics import Mask

ACTIVE, MOVING, RESTING, CLUTTER = 1, 2, 4, 8
"""What a pixel may be: it has events; what it shows moves, or could move and rests, or only looks as if it could."""
KINDS, IDS = 16, 256


class PixelCounts:
    """How many of some pixels are of each kind, (256, 16) by the object that is seen there."""

    def __init__(self, counts: NDArray[np.int64]) -> None:
        self.counts = counts
        self._of_kind: list[int] = counts.sum(axis=0).tolist()

    def having(self, what: int = 0, *, lacking: int = 0) -> int:
        """How many are all of `what`, such as `ACTIVE | MOVING`, and nothing of `lacking`."""
        return sum(self._of_kind[kind] for kind in range(KINDS) if kind & what == what and not kind & lacking)

    def of_objects(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """How many show each object, (256,); and how many of these have events."""
        return self.counts.sum(axis=1), self.counts[:, ACTIVE::2].sum(axis=1)


class PixelClasses:
    """The kinds and objects of the pixels of a slice, for any number of masks.

    scored: how many of the scored pixels are of each.
    true_events, own_events: (N,) whether each event is at a pixel of what moves; and is of what moves, where known.
    """

    def __init__(self, sample: LabelledSlice) -> None:
        kinds = {ACTIVE: sample.active, MOVING: sample.moving, RESTING: sample.resting, CLUTTER: sample.truth.clutter}
        self._code = sample.truth.ids.astype(np.intp) * KINDS
        for kind, inside in kinds.items():
            self._code += kind * inside
        self.scored = self.count(sample.scored)
        self.true_events = sample.moving[sample.events.y, sample.events.x]
        self.own_events = None if sample.event_ids is None else sample.truth.of_movers(sample.event_ids)

    def count(self, called: Mask) -> PixelCounts:
        """How many of the pixels of a mask (H, W) are of each."""
        return PixelCounts(np.bincount(self._code[called], minlength=IDS * KINDS).reshape(IDS, KINDS))
