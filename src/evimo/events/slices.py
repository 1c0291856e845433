"""Packets of any size to slices of one length."""

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain, repeat
from typing import TypeVar

import numpy as np

from evimo.errors import BadFile, BadInput
from evimo.events.events import Events, joined

T = TypeVar("T")

SLICE_US = 25_000
LONGEST_GAP_US = 3_600_000_000  # one hour: a longer silence is a broken clock, and would be 144 000 empty slices
AT_ONCE = 4096  # slices cut by one search: bounds memory where a packet spans very many


@dataclass(frozen=True, slots=True)
class Slice:
    """The events of one interval, and which one it is.

    index:    k; the slice holds start_us = k·dt <= t < stop_us = (k + 1)·dt, in the file's own clock.
    events:   none, where nothing happened.
    """

    index: int
    start_us: int
    stop_us: int
    events: Events

    @property
    def centre_us(self) -> int:
        """The instant that estimates of this slice speak of."""
        return (self.start_us + self.stop_us) // 2


def in_slices(
    packets: Iterable[Events], dt_us: int = SLICE_US, *, start_us: int | None = None, stop_us: int | None = None
) -> Iterator[Slice]:
    """Cut packets of any size into slices [k·dt, (k + 1)·dt), whatever the packets' sizes.

    The first slice is the one that holds `start_us`, else the first event; events before it must not come. From there
    on every slice comes, the empty ones too. The unfinished last one does not: a slice is finished when an event at or
    after its end was seen, or when it ends by `stop_us`. For example dt = 10 and events at 12, 18, 35, 40 and 41 give
    [10, 20) with two events, [20, 30) with none, [30, 40) with one; [40, 50) only with stop_us = 50 or more.

    Takes time linear in events plus slices. A slice's arrays are views of the packet's where it lies within one packet,
    so readers must not overwrite what they handed out.

    Args:
        packets: follow each other in time, each sorted; empty ones are allowed.
        dt_us: length of a slice.
        start_us: where to begin; any time within the first slice.
        stop_us: until when the recording is known to last, even if no event follows.

    Raises:
        BadInput: dt_us is not positive.
        BadFile: time goes back from one packet to the next, or nothing happens for more than an hour.
    """
    if dt_us <= 0:
        raise BadInput(f"slices of {dt_us} us", fix="a positive length, such as 25000")
    index = None if start_us is None else start_us // dt_us
    seen_us = start_us if index is None else index * dt_us
    waiting: list[Events] = []
    for packet in packets:
        if not len(packet):
            continue
        _check_time(packet, seen_us)
        seen_us = int(packet.t[-1])
        index = int(packet.t[0]) // dt_us if index is None else index
        used = 0
        for cut in _cuts(packet, (index + 1) * dt_us, dt_us):
            yield _slice(index, dt_us, joined([*waiting, packet.part(used, cut)]))
            index, used = index + 1, cut
            waiting.clear()
        waiting.append(packet.part(used, len(packet)))
    if stop_us is None or index is None or seen_us is None:
        return
    _check_gap(seen_us, stop_us)
    while (index + 1) * dt_us <= stop_us:
        yield _slice(index, dt_us, joined(waiting))
        index += 1
        waiting.clear()


def _slice(index: int, dt_us: int, events: Events) -> Slice:
    return Slice(index, index * dt_us, (index + 1) * dt_us, events)


def _cuts(packet: Events, first_stop_us: int, dt_us: int) -> Iterator[int]:
    """For each slice that ends by the packet's last event: how many of the packet's events come before that end."""
    last_us = int(packet.t[-1])
    for stop_us in range(first_stop_us, last_us + 1, dt_us * AT_ONCE):
        past_us = min(stop_us + dt_us * AT_ONCE, last_us + 1)
        stops = np.array(range(stop_us, past_us, dt_us), np.int64)  # a range: np.arange overflows near the end of int64
        yield from np.searchsorted(packet.t, stops).tolist()


def _check_time(packet: Events, seen_us: int | None) -> None:
    """Refuse a packet that begins before the last one ended, and nonsense silences before or inside it."""
    first_us, last_us = int(packet.t[0]), int(packet.t[-1])
    if first_us < (first_us if seen_us is None else seen_us) or last_us < first_us:
        raise BadFile(
            f"time goes back: a packet of events from {first_us} to {last_us} us follows one that ends at {seen_us} us",
            fix="sort the recording by time",
        )
    _check_gap(first_us if seen_us is None else seen_us, first_us)
    if last_us - first_us > LONGEST_GAP_US:  # only then can there be one inside: one pass saved for usual packets
        widest = int(np.argmax(np.diff(packet.t.view(np.uint64))))
        _check_gap(int(packet.t[widest]), int(packet.t[widest + 1]))


def _check_gap(before_us: int, after_us: int) -> None:
    if after_us - before_us > LONGEST_GAP_US:
        raise BadFile(
            f"no events for {(after_us - before_us) / 3.6e9:.1f} hours, from {before_us} to {after_us} us",
            fix="repair the clock of the recording, or cut it with --start and --stop",
        )


def in_stacks(items: Iterable[T], nothing: T, *, length: int = 5) -> Iterator[tuple[T, ...]]:
    """Around each item, in order, the stack of `length` items that it is the middle of.

    A neighbour before the first or after the last item is `nothing`. A stack comes when its last item is there,
    length // 2 items later.

    Raises:
        BadInput: the length is not an odd positive number.
    """
    if length < 1 or length % 2 == 0:
        raise BadInput(f"a stack of {length} slices has no middle", fix="an odd length, such as 5")
    half = length // 2
    stack = deque([nothing] * length, length)
    for count, item in enumerate(chain(items, repeat(nothing, half))):
        stack.append(item)
        if count >= half:
            yield tuple(stack)
