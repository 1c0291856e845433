"""EVT 3.0 that arrives in messages: one clock over all of them, which the times of the messages help to count."""

import numpy as np
from numpy.typing import NDArray

from evimo.events.events import no_events
from evimo.formats.damage import MarredEvents, marred
from evimo.formats.evt3_kernel import BITS, CLOCK, decode_evt3, evt3_state

TOGETHER = 1 << 18  # words that are decoded at once: a message alone is too short to be fast
LONGEST_WORDS = 1 << 22  # no more wait for what follows
HALF = 1 << 11  # of the rounds of a TIME HIGH
PAUSE_US = 1 << 22  # half the time after which the sensor's clock, as a number, is ambiguous
NOTHING = marred([no_events()])


class Evt3Messages:
    """Decodes the words of messages in order, many messages at once; the last wait for the next call, or for `rest`."""

    def __init__(self) -> None:
        self._state: NDArray[np.int64] | None = None
        self._waiting = np.empty(2 * TOGETHER, np.uint16)
        self._count, self._new = 0, 0  # words that wait, and how many of them were not looked at yet
        self._expected_us = 0

    def __call__(self, words: NDArray[np.uint16], expected_us: int) -> MarredEvents:
        """Events of these words and of those that waited; expected_us is about the time of the last, 0 if not known."""
        elapsed_us = expected_us - self._expected_us
        pause_us = elapsed_us - _length_us(words) if elapsed_us > PAUSE_US and self._expected_us else 0
        before = self.rest() if pause_us > PAUSE_US else None
        state = evt3_state(expected_us) if self._state is None else self._state
        if before is not None and state[CLOCK] >= 0:
            state[CLOCK] += pause_us >> BITS
        self._state = state
        self._expected_us = expected_us
        self._keep(words)
        now = self._decoded(state, final=False) if self._new >= TOGETHER else NOTHING
        return now if before is None else marred([before, now])

    def rest(self) -> MarredEvents:
        """The events of words that still wait, because no others follow."""
        return NOTHING if self._state is None else self._decoded(self._state, final=True)

    def _keep(self, words: NDArray[np.uint16]) -> None:
        """Copy them behind those that wait, or all that is packed together with a message would wait in memory."""
        count = self._count + len(words)
        if count > len(self._waiting):
            self._waiting = np.concatenate([self._waiting, np.empty(count, np.uint16)])
        self._waiting[self._count : count] = words
        self._count, self._new = count, self._new + len(words)

    def _decoded(self, state: NDArray[np.int64], *, final: bool) -> MarredEvents:
        words = self._waiting[: self._count]
        x, y, t, p, used, lost = decode_evt3(words, state, final or len(words) > LONGEST_WORDS)
        self._count, self._new = len(words) - used, 0
        self._waiting[: self._count] = words[used:]
        return MarredEvents(x, y, t, p, lost=lost)


def _length_us(words: NDArray[np.uint16]) -> int:
    """About how long a message lasts, by the rounds that its own TIME HIGH words make."""
    high = words[words >> 12 == 8].astype(np.int64)
    return int(np.sum((np.diff(high) + HALF) % (2 * HALF) - HALF)) << BITS
