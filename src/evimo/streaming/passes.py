"""The networks' way from stacks of slices to answers, several slices side by side.

The first pass looks at the events as they come; what it found is corrected by direct alignment, and the second pass
looks at the events without the camera's motion.
"""

from collections.abc import Callable, Generator
from contextlib import closing
from functools import partial
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evimo.events.direct_alignment import aligned
from evimo.events.events import Events
from evimo.events.local_motion import motion_candidates
from evimo.events.slices import Slice, in_stacks
from evimo.events.stack import EventStack
from evimo.formats.event_file import EventFile
from evimo.geometry.rectification import Rectification
from evimo.streaming.inference import Answer, CameraMotion, Network
from evimo.streaming.looks import Looks
from evimo.streaming.rotation import ALIGNED_OVER, SLICE_S, UNKNOWN, Rotation, rotation_of
from evimo.streaming.span import STACKED, Span
from evimo.streaming.stopwatch import Stopwatch
from evimo.streaming.threads import in_parallel


class Stacked(NamedTuple):
    """One slice, its events (and its neighbours', if they are to be labelled), and the stack it is the middle of."""

    part: Slice
    window: Events
    stack: EventStack


def near(stacks: Generator[Stacked], span: Span) -> Generator[Stacked]:
    """The stacks of the span's slices, and of a neighbour to each side."""
    with closing(stacks):
        yield from (each for each in stacks if span.is_near(each.part.index))


class Looked(NamedTuple):
    """A stack, and what the first pass says of its middle slice; None where that has no events."""

    stacked: Stacked
    motion: CameraMotion | None


class TwoPasses:
    """Both passes of a network over a recording's stacks."""

    def __init__(self, network: Network, rectification: Rectification, stopwatch: Stopwatch) -> None:
        self._network = network
        self._looks = Looks(rectification, stride=network.stride)
        self._stopwatch = stopwatch

    def answers(
        self, stacks: Generator[Stacked], span: Span, rotation: Rotation
    ) -> Generator[tuple[Stacked, Answer | None]]:
        """Each slice of the span, and a neighbour to each side, with what the networks say of it if it has events."""
        workers = self._network.workers
        firsts = in_parallel(partial(self._first_of, rotation), stacks, workers=workers)
        return in_parallel(partial(self._second_of, rotation), _looked(firsts, span), workers=workers)

    def rotation(self, events: EventFile, stacks: Callable[[], Generator[Stacked]]) -> Rotation:
        """What is known of the camera's rotation; stacks are asked for if a gyroscope's axes have to be found."""
        return rotation_of(events, partial(self._rotations, stacks))

    def _rotations(self, stacks: Callable[[], Generator[Stacked]]) -> tuple[list[int], NDArray[np.float64]]:
        """Centres of the first slices, and the rotation that the first pass sees in them, rad/s."""
        with closing(stacks()) as some:
            looked = [self._first(each, UNKNOWN) for each in islice(some, ALIGNED_OVER)]
        seen = [(each.stacked.part.centre_us, each.motion.ego[3:] / SLICE_S) for each in looked if each.motion]
        rates = [rate for _, rate in seen]
        return [centre_us for centre_us, _ in seen], np.array(rates, np.float64).reshape(-1, 3)

    def _first_of(self, rotation: Rotation, stacked: Stacked) -> Looked:
        return self._first(stacked, rotation.of_slice(stacked.part.start_us, stacked.part.stop_us))

    def _first(self, stacked: Stacked, rotation: NDArray[np.float32]) -> Looked:
        if not len(stacked.part.events):
            return Looked(stacked, None)
        with self._stopwatch.stage("first look"):
            seen = self._looks.first(stacked.stack, rotation)
        with self._stopwatch.stage("local motion"):
            candidates = motion_candidates(seen.voxels)
        with self._stopwatch.stage("first pass"):
            return Looked(stacked, self._network.first(seen, candidates))

    def _second_of(self, rotation: Rotation, row: tuple[Looked, ...]) -> tuple[Stacked, Answer | None]:
        middle = row[STACKED // 2]
        part = middle.stacked.part
        if middle.motion is None:
            return middle.stacked, None
        known = rotation.of_slice(part.start_us, part.stop_us)
        with self._stopwatch.stage("alignment"):
            first = self._looks.static_motion([each.motion for each in row if each.motion])
            motion = aligned(middle.stacked.stack, first, known_rotation=known[3] > 0)
        with self._stopwatch.stage("second look"):
            seen = self._looks.second(middle.stacked.stack, motion, known)
        with self._stopwatch.stage("second pass"):
            taken = middle.motion._replace(ego=motion.twist[STACKED // 2])
            return middle.stacked, self._network.second(seen, taken)


def _looked(firsts: Generator[Looked], span: Span) -> Generator[tuple[Looked, ...]]:
    """Five in a row around each slice of the span and its neighbours; at the ends the nearest again."""
    with closing(firsts):
        for row in in_stacks(firsts, None, length=STACKED):
            middle = row[STACKED // 2]
            if middle is not None and span.is_near(middle.stacked.part.index):
                yield tuple(_nearest(row, number, middle) for number in range(STACKED))


def _nearest(row: tuple[Looked | None, ...], number: int, middle: Looked) -> Looked:
    """The one at that place, or the nearest to it towards the middle, of those with events."""
    towards = range(number, STACKED // 2, 1 if number < STACKED // 2 else -1)
    return next((each for k in towards if (each := row[k]) is not None and each.motion), middle)
