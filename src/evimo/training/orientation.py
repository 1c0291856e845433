"""A sample the other way round: mirrored, with polarities exchanged, or filmed backwards."""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from evimo.events.stack import EventStack

T = TypeVar("T", bound=np.generic)


@dataclass(frozen=True, slots=True, kw_only=True)
class Orientation:
    """Which way round a camera would have filmed what it filmed.

    mirrored: along x, along y. A mirror along x turns the x of vectors, and of turns everything but x.
    swapped:  polarities are exchanged, as of a negative.
    reversed: time runs backwards: what became brighter becomes darker, and all motion is the opposite.
    """

    mirrored: tuple[bool, bool] = (False, False)
    swapped: bool = False
    reversed: bool = False

    def of_events(self, stack: EventStack, size: tuple[int, int]) -> EventStack:
        """Events in an image of `size` (height, width)."""
        x = size[1] - 1 - stack.x if self.mirrored[0] else stack.x
        y = size[0] - 1 - stack.y if self.mirrored[1] else stack.y
        positive = ~stack.positive if self.swapped != self.reversed else stack.positive
        return EventStack(x, y, -stack.t if self.reversed else stack.t, positive)

    def of_image(self, image: NDArray[T]) -> NDArray[T]:
        """Of pixels (..., H, W)."""
        image = image[..., ::-1] if self.mirrored[0] else image
        return np.ascontiguousarray(image[..., ::-1, :] if self.mirrored[1] else image)

    def of_vectors(self, image: NDArray[np.float32]) -> NDArray[np.float32]:
        """Velocities (2 or 3, H, W) of an image."""
        return self.of_image(image) * self._signs[: len(image), None, None]

    def of_twist(self, twist: NDArray[np.float32]) -> NDArray[np.float32]:
        """A twist (6,)."""
        forwards = -1 if self.reversed else 1
        handed = forwards * self._signs.prod()  # turns are what a mirror leaves, and the other way round
        return np.concatenate((twist[:3] * self._signs, twist[3:] * self._signs * handed))

    def of_intrinsics(self, intrinsics: NDArray[np.float32], size: tuple[int, int]) -> NDArray[np.float32]:
        """(4,) fx fy cx cy of an image of `size` (height, width)."""
        fx, fy, cx, cy = intrinsics.tolist()
        cx = size[1] - 1 - cx if self.mirrored[0] else cx
        cy = size[0] - 1 - cy if self.mirrored[1] else cy
        return np.array((fx, fy, cx, cy), np.float32)

    @property
    def _signs(self) -> NDArray[np.float32]:
        """(3,) what becomes of a velocity along x, y and z."""
        turned = np.array([-1.0 if mirrored else 1.0 for mirrored in (*self.mirrored, False)], np.float32)
        return -turned if self.reversed else turned


AS_FILMED = Orientation()


def drawn_orientation(rng: Generator) -> Orientation:
    """At random; upside down and backwards less often."""
    chances = rng.random(4)
    return Orientation(
        mirrored=(bool(chances[0] < 0.5), bool(chances[1] < 0.25)),
        swapped=bool(chances[2] < 0.5),
        reversed=bool(chances[3] < 0.3),
    )
