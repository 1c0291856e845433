"""From a scene to events: frames in steps fine enough for the motion, through the lens, into the pixels."""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadInput
from evimo.events.events import Events
from evimo.scene.renderer import MARGIN, Frames, Renderer
from evimo.simulate.pixels import Pixels, blurred
from evimo.simulate.sensor import SensorSettings

if TYPE_CHECKING:
    from evimo.simulate.cuda_film import CudaFilm

F8 = NDArray[np.float64]
Strides = NDArray[np.int32]

STEP_PX = 0.75  # the fastest one pixel in a hundred moves this far between frames
SHORTEST_S, LONGEST_S = 0.0004, 0.005  # between frames


class Exposed(NamedTuple):
    """Events between the first and the last of some frames, up to jitter; the frames, and how often tiles were cast."""

    events: Events
    frames: Frames
    strides: Strides


class Film:
    """Frames and events on the CPU; every call goes on where the last one ended."""

    def __init__(
        self, renderer: Renderer, settings: SensorSettings, rng: np.random.Generator, *, start_s: float
    ) -> None:
        self.renderer, self.settings = renderer, settings
        self.last = renderer.frames(np.array([start_s]))
        self.blurred = blurred(self.last.image, settings.blur_px)
        self.pixels = Pixels(settings, rng, first=self.blurred[0], start_s=start_s)

    def run(self, time_s: F8, strides: Strides) -> Exposed:
        """What happens from the first to the last of the times (F,), with frames at each; strides of `steps`."""
        self.last = self.renderer.film(time_s, strides, self.last)
        image = np.concatenate((self.blurred, blurred(self.last.image[1:], self.settings.blur_px)))
        self.blurred = image[-1:]
        return Exposed(self.pixels.events(image, time_s), self.last, strides)


def check_device(device: str) -> None:
    """Make sure that it can film.

    Raises:
        BadInput: it is neither `cpu` nor `cuda`, or there is no GPU or no numba-cuda.
    """
    if device not in ("cpu", "cuda"):
        raise BadInput(f"no device {device!r}", fix="cpu or cuda")
    if device == "cuda":
        from evimo.scene.rays.on_device import check_cuda

        check_cuda()


def film_on(device: str) -> "type[Film | CudaFilm]":
    """The kind of film that a device makes."""
    if device == "cpu":
        return Film
    from evimo.simulate.cuda_film import CudaFilm

    return CudaFilm


def steps(renderer: Renderer, start_s: float, stop_s: float) -> tuple[F8, Strides]:
    """Times (4 n + 1,) of frames from start to stop, for the motion between; each tile's stride, 1, 2 or more.

    The fastest one pixel in a hundred moves STEP_PX between frames, and none over twice that, if SHORTEST_S allows.
    """
    speed = _speed(renderer, start_s, stop_s)
    time_s, fastest = _frame_times(speed, start_s, stop_s), renderer.by_tile(speed)
    possible = np.array([n for n in (1, 2, 4, 8, 16) if len(time_s) // 2 % n == 0])
    step_s = (stop_s - start_s) / (len(time_s) - 1)
    enough = np.clip(STEP_PX / np.maximum(fastest, 1e-3), 0, LONGEST_S) / step_s
    return time_s, possible[np.searchsorted(possible, enough, "right").clip(1) - 1].astype(np.int32)


def _frame_times(speed: F8, start_s: float, stop_s: float) -> F8:
    """Times (4 n + 1,) of frames from start to stop, where coarse rays' points move at up to `speed` (N,) px/s."""
    wanted_s = STEP_PX / max(float(np.percentile(speed, 99)), 0.5 * float(speed.max()), 1e-3)
    quarters = math.ceil((stop_s - start_s) / min(LONGEST_S, max(SHORTEST_S, wanted_s)) / 4)
    return np.linspace(start_s, stop_s, 4 * quarters + 1)


def _more_looks(speed: F8, start_s: float, stop_s: float) -> F8:
    """When to look at the motion again (L,), after a look in the middle: if anything goes beyond MARGIN by then."""
    crosses = float(speed.max()) * (stop_s - start_s) >= MARGIN
    return np.array((start_s, stop_s)) if crosses else np.empty(0)


def _speed(renderer: Renderer, start_s: float, stop_s: float) -> F8:
    """The most that each coarse ray's point moves, px/s (N,)."""

    def at(time_s: float) -> F8:
        return np.linalg.norm(renderer.glance_flow(time_s), axis=0) * renderer.camera.fx

    speed = at(0.5 * (start_s + stop_s))
    return np.max([speed, *(at(float(time_s)) for time_s in _more_looks(speed, start_s, stop_s))], axis=0)
