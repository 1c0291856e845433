"""Cameras to simulate: EV-IMO's own, or any of the family the network should serve."""

from dataclasses import replace

import numpy as np

from evimo.errors import BadInput
from evimo.geometry.camera import Camera

EVIMO = Camera(
    fx=257.682551525072,
    fy=257.62490404843453,
    cx=188.32594244206666,
    cy=131.5860901832534,
    height=260,
    width=346,
    distortion=(-0.3633210846969752, 0.12493858760488649, -0.00010824687666623974, -5.495966559183276e-06),
)
FOCAL = (0.5, 0.74, 1.1)  # in widths: least, most often, most
PINHOLE = 0.25  # share of cameras without distortion
PIN = 0.08  # share with pincushion distortion
STRONGEST = 0.4  # -k1 at most; EV-IMO's is 0.36


def draw_camera(rng: np.random.Generator, kind: str, size: tuple[int, int]) -> Camera:
    """A camera of sensor (height, width): `random`, or `evimo`, EV-IMO's calibration scaled to the size.

    Raises:
        BadInput: another kind.
    """
    if kind == "evimo":
        return EVIMO.resized(*size)
    if kind != "random":
        raise BadInput(f"no camera {kind!r}", fix="random or evimo")
    height, width = size
    focal = width * float(rng.triangular(*FOCAL))
    camera = Camera(
        fx=focal,
        fy=focal * (1 + 0.005 * float(rng.normal())),
        cx=(width - 1) / 2 + 0.02 * width * float(rng.normal()),
        cy=(height - 1) / 2 + 0.02 * width * float(rng.normal()),
        height=height,
        width=width,
    )
    return replace(camera, distortion=_distortion(rng))


def _distortion(rng: np.random.Generator) -> tuple[float, ...]:
    """None, barrel up to a little over EV-IMO's, or slight pincushion; always monotonic (k2 > 0.45 k1²)."""
    chance = rng.random()
    if chance < PINHOLE:
        return ()
    k1 = float(rng.uniform(0, 0.05)) if chance < PINHOLE + PIN else -float(rng.uniform(0.02, STRONGEST))
    k2 = k1 * k1 * float(rng.uniform(0.6, 1.1))
    p1, p2 = (float(p) for p in rng.normal(0, 3e-4, 2))
    return (k1, k2, p1, p2)
