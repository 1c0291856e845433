"""The formulas: numbers in, one number out, each with its unit (datasets-and-protocols.md, 5.1)."""

from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadInput

Floats = NDArray[np.floating[Any]]
Mask = NDArray[np.bool_]

SMALLEST_DEPTH = 1e-6
"""A predicted depth below this counts as this: its logarithm stays finite, its error large."""


class DepthErrors(NamedTuple):
    """The six depth metrics, none with a unit; lower is better for the first three, higher for the shares."""

    abs_rel: float
    rmse_log: float
    silog: float
    delta_1: float
    delta_2: float
    delta_3: float


def overlap(predicted: Mask, truth: Mask) -> tuple[int, int]:
    """Size of the intersection and of the union of two masks, or of two labellings of the same events."""
    return int(np.count_nonzero(predicted & truth)), int(np.count_nonzero(predicted | truth))


def scaled_to(predicted: Floats, truth: Floats) -> NDArray[np.float64]:
    """`predicted` (..., 3) with the length of `truth` (scale = norm); zero has no direction and stays zero."""
    length = np.linalg.norm(predicted, axis=-1, keepdims=True)
    wanted = np.linalg.norm(truth, axis=-1, keepdims=True)
    return np.divide(predicted * wanted, length, out=np.zeros(predicted.shape, np.float64), where=length > 0)


def endpoint_error(predicted: Floats, truth: Floats) -> NDArray[np.float64]:
    """Length of the difference of two velocities (..., 3), in their unit (paper, AEE before averaging)."""
    return np.linalg.norm(np.asarray(predicted, np.float64) - truth, axis=-1)


def rotation_error(predicted: Floats, truth: Floats, *, dt_s: float) -> NDArray[np.float64]:
    """Angle between two rotations of dt_s seconds given as angular velocities (..., 3) in rad/s; rad/s (paper, RRE).

    The 2-norm of the logarithm, that is the angle itself; the Frobenius norm would be sqrt(2) larger.
    """
    (cos_p, axis_p), (cos_t, axis_t) = half_turn(predicted, dt_s), half_turn(truth, dt_s)
    cosine = cos_p * cos_t + np.sum(axis_p * axis_t, axis=-1)  # of half the angle of the relative quaternion
    sine = cos_p[..., None] * axis_t - cos_t[..., None] * axis_p - np.cross(axis_p, axis_t)
    return 2 * np.arctan2(np.linalg.norm(sine, axis=-1), np.abs(cosine)) / dt_s  # arccos loses 1e-8 near zero


def half_turn(rotation: Floats, dt_s: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unit quaternion of dt_s seconds at (..., 3) rad/s: cosine (...) of half the angle, and axis times its sine."""
    half = np.asarray(rotation, np.float64) * (dt_s / 2)
    angle = np.linalg.norm(half, axis=-1)
    return np.cos(angle), half * np.sinc(angle / np.pi)[..., None]


def direction_error(predicted: Floats, truth: Floats) -> NDArray[np.float64]:
    """Angle between two velocities (..., 3) in degrees, 0 to 180; a zero vector is at 90 degrees to everything."""
    cross = np.linalg.norm(np.cross(predicted, truth), axis=-1)
    dot = np.sum(np.asarray(predicted, np.float64) * truth, axis=-1)
    return np.degrees(np.where((cross == 0) & (dot == 0), np.pi / 2, np.arctan2(cross, dot)))


def flow_error(predicted: Floats, truth: Floats, focal_px: tuple[float, float]) -> NDArray[np.float64]:
    """Endpoint error (..., H, W) in px/s of image velocities (..., 2, H, W) given in 1/s on the plane Z = 1.

    Multiplied by the focal length (fx, fy): px of a pinhole image with the sensor's focal length, the lens left out.
    """
    difference = (np.asarray(predicted, np.float64) - truth) * np.reshape(focal_px, (2, 1, 1))
    return np.hypot(difference[..., 0, :, :], difference[..., 1, :, :])


def median_scale(predicted: Floats, truth: Floats) -> float:
    """Metres per unit of relative depth: median of the true depths over median of the predicted ones."""
    return float(np.median(truth) / max(float(np.median(predicted)), SMALLEST_DEPTH))


def depth_errors(predicted: Floats, truth: Floats, valid: Mask, *, scale: Literal["median", "none"]) -> DepthErrors:
    """The six depth metrics over the `valid` pixels of one frame (paper, depth table).

    Natural logarithms; with d = log predicted − log true, SILog = mean d² − (mean d)², without square root.

    Args:
        predicted: relative depth, or metres with scale="none".
        truth: m, positive where valid.
        valid: where both are known.
        scale: "median" multiplies the prediction by `median_scale` of the frame.

    Raises:
        BadInput: nothing is valid.
    """
    if not valid.any():
        raise BadInput("no valid depth in this frame", fix="leave frames without known depth out before averaging")
    seen = np.maximum(predicted[valid].astype(np.float64), SMALLEST_DEPTH)
    true = truth[valid].astype(np.float64)
    if scale == "median":
        seen = seen * median_scale(seen, true)
    difference: NDArray[np.float64] = np.log(seen) - np.log(true)
    steps: NDArray[np.float64] = np.abs(difference) / np.log(1.25)
    return DepthErrors(
        abs_rel=float(np.mean(np.abs(seen - true) / true)),
        rmse_log=float(np.sqrt(np.mean(difference**2))),
        silog=float(np.var(difference)),
        delta_1=float(np.mean(steps < 1)),
        delta_2=float(np.mean(steps < 2)),
        delta_3=float(np.mean(steps < 3)),
    )
