"""Which slices a run covers: the grid belongs to the recording's clock, whatever start and stop are."""

import math
from dataclasses import dataclass

from evimo.arguments import number_of
from evimo.errors import BadInput
from evimo.events.slices import SLICE_US
from evimo.formats.event_file import EventFile

STACKED = 5  # slices of a stack, two before and two after its middle one
AGREEING = 3  # slices whose masks agree: one before, the slice itself and one after
SECONDS = "seconds after the first event, as in 0.5"
CONTEXT = 2 * (STACKED // 2) + AGREEING // 2  # slices to each side that an estimate depends on: stacks of stacks


@dataclass(frozen=True, slots=True)
class Span:
    """The slices first <= k < last of a recording, and what has to be read for them.

    read_start_us, read_stop_us: events of the slices and their neighbours in the stacks.
    """

    first: int
    last: int
    read_start_us: int
    read_stop_us: int

    def __len__(self) -> int:
        return max(0, self.last - self.first)

    def is_near(self, index: int) -> bool:
        """Whether a slice is one of them, or agrees with one of them."""
        return self.first - AGREEING // 2 <= index < self.last + AGREEING // 2

    @property
    def length_s(self) -> float:
        """Seconds of recording that the slices cover."""
        return len(self) * SLICE_US / 1e6


def span_of(events: EventFile, *, start_s: float = 0.0, stop_s: float | None = None) -> Span:
    """The slices from the one that holds `start_s` to the last one that ends by `stop_s`.

    Args:
        events: the recording.
        start_s: seconds after its first event.
        stop_s: seconds after its first event; None is the end.

    Raises:
        BadInput: the span holds no complete slice.
    """
    return span_between(events.start_us, events.stop_us, start_s=start_s, stop_s=stop_s)


def span_between(begin_us: int, end_us: int, *, start_s: float = 0.0, stop_s: float | None = None) -> Span:
    """The same of anything that lasts from one time to another.

    Raises:
        BadInput: as `span_of`.
    """
    start_s = number_of(start_s, "the start", fix=SECONDS)
    stop_s = None if stop_s is None else number_of(stop_s, "the stop", fix=SECONDS)
    length_s = (end_us - begin_us) / 1e6
    until_s = length_s if stop_s is None else stop_s
    if not (math.isfinite(start_s) and math.isfinite(until_s)) or not 0 <= start_s < min(until_s, length_s):
        raise BadInput(
            f"from {start_s:g} s to {until_s:g} s is no part of a recording of {length_s:.3f} s",
            fix=f"0 <= start < stop <= {length_s:.3f}, in seconds after the first event",
        )
    stop_us = min(begin_us + round(until_s * 1e6), end_us)
    first, last = (begin_us + round(start_s * 1e6)) // SLICE_US, stop_us // SLICE_US
    if first >= last:
        raise BadInput(
            f"no complete slice of {SLICE_US / 1e3:g} ms between {start_s:g} s and {until_s:g} s",
            fix="a longer span; slices lie on multiples of 25 ms of the recording's own clock",
        )
    return Span(
        first=first,
        last=last,
        read_start_us=max(begin_us, (first - CONTEXT) * SLICE_US),
        read_stop_us=min(end_us, (last + CONTEXT) * SLICE_US),
    )
