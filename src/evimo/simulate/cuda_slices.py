# pyright: basic
"""Slices made straight into arrays on a GPU, without a list of events: what training reads, in the rectified image."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from evimo.events.frames import PixelTable
from evimo.geometry.rectification import Rectification, rectified
from evimo.scene.rays.on_device import uploaded
from evimo.scene.renderer import Renderer
from evimo.simulate.cuda_film import CudaFilm
from evimo.simulate.cuda_pixels import SliceSums, slice_sums
from evimo.simulate.cuda_splat import Splat, frames_of, milliseconds_of, splat_through
from evimo.simulate.cuda_truth import Places, add_truth, kinds_of, motions_at, nothing_seen, places_of, speeds
from evimo.simulate.film import frame_times, more_looks
from evimo.simulate.recording import EVENT_STREAM, SLICE_S, WARM_UP_S, SimulatedRecording

FRAMES_AT_ONCE = 256  # rendered in one go, about: bounds memory


@dataclass(frozen=True, slots=True)
class Ready:
    """What the CPU works out of a recording before a GPU films it: most of a second, perhaps in a thread of its own."""

    recording: SimulatedRecording
    renderer: Renderer
    rectification: Rectification
    splat: Splat
    places: Places


class CudaSlices(NamedTuple):
    """All slices of one recording in the rectified image (h, w): the fields of `Prepared`; float32 instead of float16.

    On the GPU, but `intrinsics`, `valid`, `velocity` and `ego`, which are small. sums, splat: for `milliseconds`.
    """

    intrinsics: np.ndarray
    frames: Any
    valid: np.ndarray
    depth: Any
    ids: Any
    moving: Any
    clutter: Any
    flow: Any
    velocity: np.ndarray
    ego: np.ndarray
    sums: SliceSums
    splat: Splat

    def milliseconds(self) -> Any:
        """Events of each millisecond, (S, 25, h, w) float32: made on demand, for they take ten times a slice's room."""
        return milliseconds_of(self.sums, self.splat, self.frames.shape[2:])


def made_ready(recording: SimulatedRecording) -> Ready:
    """Work out what follows from the camera alone."""
    renderer, rectification = Renderer(recording.scene, recording.camera), rectified(recording.camera)
    assert renderer.cones is not None  # made here, and with it the lens: cached
    splat = splat_through(PixelTable(*rectification.table()))
    return Ready(recording, renderer, rectification, splat, places_of(renderer, rectification))


def simulated_slices(ready: Ready) -> CudaSlices:
    """Film a recording into arrays on the GPU. Memory grows with its length: 5.5 MB a slice of 346x260 px."""
    recording, renderer, size = ready.recording, ready.renderer, ready.rectification.image.size
    rng = np.random.default_rng((recording.seed, recording.set_number, EVENT_STREAM))
    film = CudaFilm(renderer, recording.settings, rng, start_s=-WARM_UP_S)
    number, tick_us = recording.camera.height * recording.camera.width, recording.settings.tick_us
    sums = slice_sums(recording.slices, number, start_us=0, tick_us=tick_us)
    motions = motions_at(renderer, np.arange(0.5, recording.slices) * SLICE_S)
    kinds, seen = kinds_of(renderer, motions), nothing_seen(recording.slices, size)
    known = uploaded(motions), uploaded(ready.places), uploaded(kinds)
    warm_up, stretches = _times(film, recording.slices)
    film.pixels.add_events(film.fed([warm_up])[0], sums)
    for first, some in _chunks(stretches):
        fed, frames = film.fed(some)
        film.pixels.add_events(fed, sums)
        lengths = np.array([len(times) - 1 for times in some])
        add_truth(frames, np.cumsum(lengths) - lengths + lengths // 2, first, known, seen)
    velocity = np.zeros((recording.slices, 256, 3), np.float32)
    velocity[:, : kinds.moving.shape[1]] = motions.objects[..., 3:6] * kinds.moving[..., None]
    splat, image = uploaded(ready.splat), ready.rectification.image
    return CudaSlices(
        intrinsics=np.array((image.fx, image.fy, image.cx, image.cy), np.float32),
        frames=frames_of(sums, splat, size),
        valid=ready.rectification.image_valid,
        velocity=velocity,
        ego=motions.ego.astype(np.float32),
        sums=sums,
        splat=splat,
        **{name: values.reshape(*values.shape[:-1], *size) for name, values in seen._asdict().items()},
    )


def _times(film: CudaFilm, slices: int) -> tuple[np.ndarray, list[np.ndarray]]:
    """Times of the frames of the warm-up and of each slice, as `film.steps` gives them."""
    spans = [(-WARM_UP_S, 0.0), *((k * SLICE_S, (k + 1) * SLICE_S) for k in range(slices))]
    speed = _speeds(film, np.array([0.5 * (start_s + stop_s) for start_s, stop_s in spans]))
    looks = [more_looks(one, *span) for one, span in zip(speed, spans, strict=True)]
    seen = _speeds(film, np.concatenate(looks)) if any(map(len, looks)) else speed[:0]
    further = np.split(seen, np.cumsum([len(some) for some in looks])[:-1])
    fastest = [np.max([one, *more], axis=0) for one, more in zip(speed, further, strict=True)]
    warm_up, *times = (frame_times(one, *span) for one, span in zip(fastest, spans, strict=True))
    return warm_up, times


def _speeds(film: CudaFilm, time_s: np.ndarray) -> np.ndarray:
    """How fast the coarse rays' points move, px/s (S, N), at times (S,)."""
    renderer = film.renderer.renderer
    motions = uploaded(motions_at(renderer, time_s))
    return speeds(renderer.coarse_rays, *film.renderer.glance(time_s), motions, renderer.camera.fx)


def _chunks(stretches: list[np.ndarray]) -> Iterator[tuple[int, list[np.ndarray]]]:
    """The first slice and the times of frames of some slices at a time."""
    first, some = 0, []
    for k, times in enumerate(stretches):
        some.append(times)
        if sum(map(len, some)) >= FRAMES_AT_ONCE or k == len(stretches) - 1:
            yield first, some
            first, some = k + 1, []
