"""How much the way frames are sampled changes events: the default against 16 rays per pixel and steps of 0.12 px.

    python bench/sampling.py [--size 346x260] [--blur 0.55]

Three scenes seen by a clean sensor of C = 0.3 for one slice each. An event of the reference is matched by the one of
the same pixel, polarity and number; `extra` are events without a partner, as a share of all; times are compared where
events match. `px/step` says how far the image moves between two frames of a pixel: at the 99th percentile of all
pixels, and the most of any pixel.
"""

import argparse
from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from evimo.events.events import Events
from evimo.events.slices import SLICE_US
from evimo.scene.renderer import Renderer
from evimo.simulate.film import steps
from evimo.simulate.pixels import Pixels, blurred
from evimo.simulate.plan import RecordingPlan
from evimo.simulate.recording import simulate_recording
from evimo.simulate.sensor import SensorSettings

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
SCENES = ((2, 101), (5, 105), (3, 103))  # set and seed: low, medium, high speed
SIZE, BLUR_PX = (260, 346), 0.55
START_S, SLICE_S = 0.2, SLICE_US * 1e-6
FINE_PX, SIDE = 0.12, 4  # of the reference: steps, and rays per pixel each way
CLEAN: dict[str, Any] = dict.fromkeys(
    ("mismatch", "refractory_s", "bandwidth_hz", "shot_hz", "leak_hz", "jitter_s"), 0.0
)


class OneRay(Renderer):
    """Casts a single ray per pixel, `offset` px from its centre, with a share of the footprint on textures."""

    offset = (0.0, 0.0)

    @cached_property
    def lens(self) -> tuple[F4, NDArray[np.bool_]]:
        """The ray twice: pixels at edges cast the second one."""
        straight, known = self.camera.normalised(self.camera.pixels() + np.array(self.offset))
        rays = np.moveaxis(np.where(known[..., None], straight, 0), -1, 0)
        return np.ascontiguousarray(np.stack((rays, rays)), np.float32), known

    @property
    def light(self) -> F4:
        """With a ray's share of a pixel."""
        return super().light * np.array((1, 1 / SIDE), np.float32)


def finely(renderer: Renderer, time_s: F8) -> F4:
    """Frames (F, H, W) of SIDE x SIDE rays in every pixel."""
    total = np.zeros((len(time_s), *renderer.camera.size))
    for k in range(SIDE * SIDE):
        one = OneRay(renderer.scene, renderer.camera)
        one.offset = tuple((np.array(divmod(k, SIDE)) + 0.5) / SIDE - 0.5)
        total += one.frames(time_s).image
    return (total / SIDE**2).astype(np.float32)


def by_default(renderer: Renderer, time_s: F8, strides: NDArray[np.int32]) -> F4:
    """Frames (F, H, W) as recordings are made of."""
    return renderer.film(time_s, strides, renderer.frames(time_s[:1])).image


def events(image: F4, time_s: F8, blur_px: float) -> Events:
    """What a clean sensor says to frames; pixels start at random phases, alike for all."""
    image = blurred(image, blur_px)
    settings = SensorSettings(contrast=0.3, blur_px=blur_px, **CLEAN)
    pixels = Pixels(settings, np.random.default_rng(0), first=image[0], start_s=time_s[0])
    return pixels.events(image, time_s)


def numbered(found: Events) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """A number for each event, from pixel, polarity and how many came before there; and times, µs."""
    place = (found.y.astype(np.int64) << 17) + (found.x.astype(np.int64) << 1) + (found.p > 0)
    order = np.lexsort((found.t, place))
    place = place[order]
    first = np.r_[0, np.flatnonzero(np.diff(place)) + 1]
    before = np.arange(len(place)) - np.repeat(first, np.diff(np.r_[first, len(place)]))
    return (place << 10) + before, found.t[order]


def compared(reference: Events, found: Events) -> dict[str, float]:
    """Ratio of counts, shares matched and extra, and errors of time in ms."""
    (a, ta), (b, tb) = numbered(reference), numbered(found)
    _, ia, ib = np.intersect1d(a, b, return_indices=True)
    late = np.abs(ta[ia] - tb[ib]) * 1e-3
    return {
        "count": len(b) / len(a),
        "matched": len(ia) / len(a),
        "extra": 1 - len(ia) / max(1, len(b)),
        "ms_p50": float(np.median(late)),
        "ms_p90": float(np.percentile(late, 90)),
    }


def rows(size: tuple[int, int], blur_px: float) -> Iterator[dict[str, Any]]:
    """One row per scene and way to sample."""
    for set_number, seed in SCENES:
        film = simulate_recording(
            RecordingPlan(seed=seed, set_number=set_number, seconds=0.5, camera="evimo", size=size)
        )
        renderer = Renderer(film.scene, film.camera)
        middle_s = START_S + 0.5 * SLICE_S
        speed = np.linalg.norm(renderer.glance_flow(middle_s), axis=0) * film.camera.fx
        time_s, strides = steps(renderer, START_S, START_S + SLICE_S)
        fine_s = np.linspace(START_S, START_S + SLICE_S, round(SLICE_S * np.percentile(speed, 99) / FINE_PX) + 2)
        once = np.ones_like(strides)
        reference_image = finely(renderer, fine_s)
        reference = events(reference_image, fine_s, blur_px)
        ways = {
            "default": (by_default(renderer, time_s, strides), time_s, strides),
            "default, every tile in every frame": (by_default(renderer, time_s, once), time_s, once),
            "default rays, fine steps": (by_default(renderer, fine_s, once), fine_s, once),
            "16 rays, default steps": (finely(renderer, time_s), time_s, once),
        }
        about = {"set": set_number, "seed": seed, "px_per_s": np.percentile(speed, 99), "events": len(reference)}
        for way, (image, at, each) in ways.items():
            moved = speed.max(), np.percentile(speed, 99)
            pace = renderer.by_tile(speed) * each * (at[1] - at[0])
            found = compared(reference, events(image, at, blur_px))
            yield about | {"way": way, "p99": moved[1] * (at[1] - at[0]), "most": pace.max(), **found}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", default=f"{SIZE[1]}x{SIZE[0]}", help="width x height")
    parser.add_argument("--blur", type=float, default=BLUR_PX, help="of the lens, px")
    options = parser.parse_args()
    width, height = map(int, options.size.split("x"))
    titles = ("set", "px/s", "events", "way", "px/step p99", "most", "count", "matched", "extra", "ms p50", "ms p90")
    table = Table(*titles, title="sampling against 16 rays and 0.12 px", title_justify="left")
    for row in rows((height, width), options.blur):
        about = (f"{row['set']}", f"{row['px_per_s']:.0f}", f"{row['events']}", row["way"])
        numbers = (f"{row[k]:.3f}" for k in ("p99", "most", "count", "matched", "extra", "ms_p50", "ms_p90"))
        table.add_row(*about, *numbers)
    Console(width=150).print(table)


if __name__ == "__main__":
    main()
