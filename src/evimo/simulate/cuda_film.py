# pyright: basic
"""Frames and events on an NVIDIA GPU. Nothing but a list of events, depth and parts comes back from it."""

from typing import Any

import cv2
import numpy as np

from evimo.scene.cuda_renderer import CudaRenderer
from evimo.scene.rays.on_device import THREADS, blocks, cuda
from evimo.scene.renderer import Frames, Renderer
from evimo.simulate.bands import Fed
from evimo.simulate.cuda_pixels import CudaPixels
from evimo.simulate.film import Exposed, Strides
from evimo.simulate.pixels import Pixels
from evimo.simulate.sensor import SensorSettings

f32 = np.float32
_0 = f32(0)


@cuda.jit
def _weigh(source, weights, down, across, out):
    """One direction of a separable filter over frames (F, H, W); over the border the border pixel goes on."""
    x, y, f = cuda.grid(3)
    height, width, taps = source.shape[1], source.shape[2], len(weights)
    if x < width and y < height:
        total, reach = _0, taps // 2
        for k in range(taps):
            row = min(max(y + (k - reach) * down, 0), height - 1)
            column = min(max(x + (k - reach) * across, 0), width - 1)
            total += weights[k] * source[f, row, column]
        out[f, y, x] = total


def blurred_on_gpu(image: Any, sigma_px: float) -> Any:
    """Frames (F, H, W) on the GPU through the lens's point spread: `pixels.blurred`, with the very same weights."""
    if not sigma_px:
        return image
    taps = round(8 * sigma_px + 1) | 1  # as many as OpenCV takes for float32
    weights = cuda.to_device(cv2.getGaussianKernel(taps, sigma_px, cv2.CV_32F).ravel())
    grid = ((blocks(image.shape[2]), image.shape[1], image.shape[0]), (THREADS, 1, 1))
    across, out = cuda.device_array(image.shape, np.float32), cuda.device_array(image.shape, np.float32)
    _weigh[grid](image, weights, 0, 1, across)
    _weigh[grid](across, weights, 1, 0, out)
    return out


class CudaFilm:
    """`film.Film` on the GPU: every tile is cast in every frame."""

    def __init__(
        self, renderer: Renderer, settings: SensorSettings, rng: np.random.Generator, *, start_s: float
    ) -> None:
        self.renderer, self.settings = CudaRenderer(renderer), settings
        first = blurred_on_gpu(self.renderer.frames(np.array([start_s])).image, settings.blur_px)
        self.pixels = CudaPixels(Pixels(settings, rng, first=first.copy_to_host()[0], start_s=start_s))

    def fed(self, time_s: np.ndarray) -> tuple[Fed, Any]:
        """What the pixels read, and the `Frames` at the times (F,), all on the GPU.

        The first frame is the last of the call before, cast again: cheaper than carried over.
        """
        frames = self.renderer.frames(time_s)
        image = blurred_on_gpu(frames.image, self.settings.blur_px)
        return self.pixels.fed(image, self.pixels.pixels.exposures(time_s)), frames

    def run(self, time_s: np.ndarray, strides: Strides) -> Exposed:
        """As `Film.run`, but strides are always 1, and the frames have no intensity."""
        fed, frames = self.fed(time_s)
        events, none = self.pixels.events(fed), np.empty((0, *frames.image.shape[1:]), np.float32)
        depth, tags = (values.copy_to_host() for values in frames[1:])
        return Exposed(events, Frames(none, depth, tags), np.ones_like(strides))
