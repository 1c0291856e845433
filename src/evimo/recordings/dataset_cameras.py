"""The camera of an EV-IMO or EVIMO2 recording, and a test of which principal point its maps and poses belong to.

EV-IMO's first version renders its truth with camera axes up, left and backward, applies `cx` to rows and counts rows
and columns from the far end; whether its intrinsics were meant so is an open question of that dataset. Points of one
object, carried from one frame to another by the poses, land on the object again only with the right principal point.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile, BadInput
from evimo.geometry.camera import Camera
from evimo.geometry.rotations import inverse_poses
from evimo.recordings.dataset_maps import ID_STEP, Maps, as_mask, in_mm

F8 = NDArray[np.float64]
COPY = "copy it again from the dataset"

AS_WRITTEN, SWAPPED, MIRRORED, RENDERED = "as written", "swapped", "mirrored", "swapped and mirrored"
TESTED_FRAMES = 60  # at most, from the first on
TURN_DEG, SHIFT_SHARE = 1.5, 0.02  # between frames that are compared: a principal point shows by turning or nearing
POINTS = 1500  # of an object in a frame
NEAR_MM = 10  # of depth, where a carried point counts as landed
CLEAR = 0.02  # more points that land, and a convention is better


@dataclass(frozen=True, slots=True)
class PrincipalTest:
    """How many points land on their object again, by convention; and how many there were."""

    shares: dict[str, float]
    points: int

    def best(self, usual: str) -> str:
        """The convention that most points agree with; the usual one unless another is clearly better."""
        if not self.points:
            return usual
        best = max(self.shares, key=lambda name: self.shares[name])
        return best if self.shares[best] > self.shares[usual] + CLEAR else usual


def camera_of(numbers: dict[str, Any], size: tuple[int, int], convention: str, where: str) -> Camera:
    """The camera of `meta` in this package's axes, by a convention of its principal point.

    Raises:
        BadFile: a number is missing, or they are those of no camera.
    """
    try:
        fx, fy, cx, cy = (float(numbers[name]) for name in ("fx", "fy", "cx", "cy"))
        fisheye = numbers.get("dist_model") == "equidistant"
        # Version 1 has no p1 and p2: it writes them under the names k3 and k4, and its renderer hardly uses them.
        tangential = ("p1", "p2") if "dist_model" in numbers or "p1" in numbers else ("k3", "k4")
        names = ("k1", "k2", "k3", "k4") if fisheye else ("k1", "k2", *tangential)
        distortion = tuple(float(numbers.get(name, 0.0)) for name in names)
        if not fisheye and tangential[0] == "p1" and (third := float(numbers.get("k3", 0.0))):
            distortion = (*distortion, third)
        height, width = size
        if convention in (SWAPPED, RENDERED):
            fx, fy, cx, cy = fy, fx, cy, cx
        if convention in (MIRRORED, RENDERED):
            cx, cy = width - 1 - cx, height - 1 - cy
        return Camera(fx, fy, cx, cy, height, width, distortion, "fisheye" if fisheye else "radtan")
    except (KeyError, TypeError, ValueError, OverflowError, BadInput) as error:
        why = f"lacks {error}" if isinstance(error, KeyError) else str(error).splitlines()[0]
        raise BadFile(f"{where}['meta'] holds no camera: {why}", fix=COPY) from error


def as_drawn(camera: Camera, convention: str) -> Camera:
    """The camera whose pixel centres a dataset's maps show: its renderer cuts coordinates off instead of rounding them.

    So pixel k of a map shows what `meta`'s camera sees at k + 1/2, and at k - 1/2 where rows and columns are counted
    from the far end. It is for where maps meet poses. Against events nothing is shifted: extrinsics were tuned by eye
    on pictures drawn so, in steps of a quarter of a pixel or more, and whether that took the half back no file tells.
    """
    half = 0.5 if convention in (MIRRORED, RENDERED) else -0.5
    return replace(camera, cx=camera.cx + half, cy=camera.cy + half)


def is_first_version(numbers: dict[str, Any], size: tuple[int, int], where: str) -> bool:
    """Whether `meta` is of EV-IMO's first version, whose `res_x` is the height.

    Raises:
        BadFile: neither order fits the maps.
    """
    stated = (numbers.get("res_x"), numbers.get("res_y"))
    if stated == (None, None):
        return "dist_model" not in numbers
    if stated not in (size, size[::-1]):
        raise BadFile(f"{where} says {stated[0]}x{stated[1]} px, the maps are {size[1]}x{size[0]}", fix=COPY)
    return "dist_model" not in numbers if size[0] == size[1] else stated == size


def principal_test(maps: Maps, placed: dict[int, F8], cameras: dict[str, Camera], frames: list[int]) -> PrincipalTest:
    """Carry points of each object between frames in which it is seen from elsewhere, with each camera.

    placed: id to cam_from_object (F, 4, 4), in this package's axes. frames: of `meta`, whose rows have maps.
    """
    landed, points = dict.fromkeys(cameras, 0), 0
    seen: dict[int, list[tuple[NDArray[np.float32], NDArray[np.bool_], F8]]] = {}
    for frame in frames[:TESTED_FRAMES]:
        depth, ids = in_mm(maps.read("depth", frame)), as_mask(maps.read("mask", frame)) // ID_STEP
        for key, poses in placed.items():
            inside = (ids == key) & (depth > 0)
            views = seen.setdefault(key, [])
            if not np.isfinite(poses[frame]).all() or np.count_nonzero(inside) < 100:
                continue
            if not views or _differs(views[-1][2], poses[frame]):
                views.append((depth, inside, poses[frame]))
    for views in seen.values():
        # Half of all views apart: the farther an object has turned, the more a wrong principal point shows.
        for one, two in zip(views, views[max(1, len(views) // 2) :], strict=False):
            tried = _tried(one[1])
            points += len(tried)
            for name, camera in cameras.items():
                landed[name] += _landed(tried, one, two, camera)
    return PrincipalTest({name: number / max(points, 1) for name, number in landed.items()}, points)


def _differs(one: F8, two: F8) -> bool:
    """Whether an object is seen from elsewhere: turned, or nearer."""
    trace = float(np.sum(one[:3, :3] * two[:3, :3]))
    angle = np.degrees(np.arccos(np.clip((trace - 1) / 2, -1, 1)))
    return angle > TURN_DEG or abs(two[2, 3] / one[2, 3] - 1) > SHIFT_SHARE


def _tried(inside: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Some pixels (N, 2) of an object, row and column, evenly."""
    found = np.argwhere(inside)
    return found[:: max(1, len(found) // POINTS)]


def _landed(
    tried: NDArray[np.int64],
    one: tuple[NDArray[np.float32], NDArray[np.bool_], F8],
    two: tuple[NDArray[np.float32], NDArray[np.bool_], F8],
    camera: Camera,
) -> int:
    """How many points of the first view land on the object in the second, at its depth."""
    z = one[0][tried[:, 0], tried[:, 1]].astype(np.float64)
    straight, known = camera.normalised(tried[:, ::-1].astype(np.float64))
    points = np.concatenate((straight * z[:, None], z[:, None]), axis=1) * 1e-3
    motion = two[2] @ inverse_poses(one[2])
    moved = points @ motion[:3, :3].T + motion[:3, 3]
    ahead = known & (moved[:, 2] > 1e-3)
    xy = moved[:, :2] / np.where(ahead, moved[:, 2], 1)[:, None]
    column, row = np.rint(camera.project(xy)).T
    height, width = camera.size
    inside = ahead & camera.sees(xy) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
    at = row[inside].astype(np.int64), column[inside].astype(np.int64)
    return int(np.count_nonzero(two[1][at] & (np.abs(two[0][at] - 1000 * moved[inside, 2]) < NEAR_MM)))
