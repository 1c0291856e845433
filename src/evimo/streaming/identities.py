"""Ids carried over slices by overlap."""

from collections import deque
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from evimo.streaming.tallies import shared_pixels

U1 = NDArray[np.uint8]

MEMORY = 8  # slices for which an object may be lost and keep its id: 0.2 s
LASTING = 4  # slices after which an object is no flicker: 0.1 s
LEAST_OVERLAP = 0.05  # intersection over union; chance overlaps of a crumb are smaller
MOST = 255  # ids in a byte, 0 being the background


class Identities:
    """Gives each region of a slice the id of the region it overlaps most in the slices before.

    A region lost for up to `MEMORY` slices gets its id back where it was last seen. Ids are 1...255; those given up
    longest ago are used again first, and no id is ever in two places.

    given:   how many new ids there were.
    lasting: how many of them were seen in `LASTING` slices or more.
    """

    def __init__(self) -> None:
        self.given = self.lasting = 0
        self._seen: dict[int, int] = {}  # known id to slices in which it was seen
        self._last: U1 | None = None  # where each known id was last seen, newer over older
        self._missed: dict[int, int] = {}  # known id to slices since it was seen
        self._free = deque(range(1, MOST + 1))

    def follow(self, labels: U1) -> U1:
        """Labels of regions 1...n, (h, w), to ids, (h, w)."""
        count = int(labels.max(initial=0))
        last = np.zeros_like(labels) if self._last is None else self._last
        ids = self._matched(labels, last, count)
        self._age(set(ids.values()))
        for label in range(1, count + 1):
            if label not in ids:
                ids[label] = self._fresh(last)
                self._missed[ids[label]] = 0
        self._count(ids.values())
        table = np.zeros(256, np.uint8)
        table[list(ids)] = list(ids.values())
        found = table[labels]
        self._remember(found, last)
        return found

    def _matched(self, labels: U1, last: U1, count: int) -> dict[int, int]:
        """Label to id, the best overlap first, each side once."""
        shared = shared_pixels(labels, last)[: count + 1]
        area, last_area = shared.sum(axis=1), shared.sum(axis=0)
        label, known = (index + 1 for index in np.nonzero(shared[1:, 1:]))
        inside = shared[label, known]
        overlap = inside / (area[label] + last_area[known] - inside)
        ids: dict[int, int] = {}
        for best in np.argsort(-overlap, kind="stable"):
            pair = int(label[best]), int(known[best])
            if overlap[best] >= LEAST_OVERLAP and pair[0] not in ids and pair[1] not in ids.values():
                ids[pair[0]] = pair[1]
        return ids

    def _age(self, seen: set[int]) -> None:
        """Count a slice without each unseen id, and give up those lost too long."""
        for number in [*self._missed]:
            self._missed[number] = 0 if number in seen else self._missed[number] + 1
            if self._missed[number] > MEMORY:
                self._give_up(number)

    def _count(self, present: Iterable[int]) -> None:
        for number in present:
            self._seen[number] = self._seen.get(number, 0) + 1
            self.lasting += self._seen[number] == LASTING

    def _give_up(self, number: int) -> None:
        del self._missed[number], self._seen[number]
        self._free.append(number)

    def _fresh(self, last: U1) -> int:
        """An id that nobody has; if all are known, that of the object lost longest ago.

        Of at most 255 regions one has no id yet, so one of the 255 ids is not in this slice.
        """
        if not self._free:
            oldest = max(self._missed, key=lambda number: self._missed[number])
            self._give_up(oldest)
            last[last == oldest] = 0
        self.given += 1
        return self._free.popleft()

    def _remember(self, found: U1, last: U1) -> None:
        """Keep where each known id was last seen."""
        waiting = np.zeros(256, np.bool_)
        waiting[[number for number, missed in self._missed.items() if missed]] = True
        self._last = np.where((found == 0) & waiting[last], last, found)
