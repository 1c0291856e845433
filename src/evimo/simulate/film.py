"""From a scene to events: frames in steps fine enough for the motion, through the lens, into the pixels."""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadInput
from evimo.events.events import Events
from evimo.scene.renderer import Frames, Renderer
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
        from evimo.scene.on_device import check_cuda

        check_cuda()


def film_on(device: str) -> "type[Film | CudaFilm]":
    """The kind of film that a device makes."""
    if device == "cpu":
        return Film
    from evimo.simulate.cuda_film import CudaFilm

    return CudaFilm


def steps(renderer: Renderer, start_s: float, stop_s: float) -> tuple[F8, Strides]:
    """Times (4 n + 1,) of frames from start to stop, for the motion in the middle; each tile's stride, 1, 2 or more."""
    seconds, middle_s = stop_s - start_s, 0.5 * (start_s + stop_s)
    speed = np.linalg.norm(renderer.glance_flow(middle_s), axis=0) * renderer.camera.fx
    wanted = np.clip(STEP_PX / np.maximum(speed, 1e-3), SHORTEST_S, LONGEST_S)
    quarters = math.ceil(seconds / float(np.percentile(wanted, 1)) / 4)
    fastest = renderer.by_tile(speed)
    possible = np.array([n for n in (1, 2, 4, 8, 16) if 2 * quarters % n == 0])
    step_s = seconds / (4 * quarters)
    enough = np.clip(STEP_PX / np.maximum(fastest, 1e-3), 0, LONGEST_S) / step_s
    strides = possible[np.searchsorted(possible, enough, "right").clip(1) - 1].astype(np.int32)
    return np.linspace(start_s, stop_s, 4 * quarters + 1), strides
