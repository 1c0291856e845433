"""Images of a target and poses collected together, as EVIMO2's calibration recordings are: one pose for each image."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from evimo.calibrating.rigid import inverse, moved, pose
from evimo.calibrating.sightings import Mocap
from evimo.errors import BadFile, BadInput, NotFound
from evimo.formats.pictures import read_picture

F8 = NDArray[np.float64]

RIG = "rig_0_poses.txt"
LINE = "`number x y z qx qy qz qw | {'marker': 'x y z'} | ...`"
MARKER = re.compile(r"\{\s*'([^']*)'\s*:\s*'([^']*)'\s*\}")


@dataclass(frozen=True, slots=True)
class Collected:
    """A set of images and what motion capture saw at the same instants.

    images:          of the camera, in order.
    world_from_rig, world_from_target: (F, 4, 4).
    markers:         (M, 3), m: of the target, on its body, the median over all instants.
    """

    images: tuple[Path, ...]
    world_from_rig: F8
    world_from_target: F8
    markers: F8

    @property
    def times_us(self) -> F8:
        """Numbers of the images, which stand for times: nothing else is known to be of one clock."""
        return np.arange(len(self.images), dtype=np.float64)

    def mocap(self) -> Mocap:
        """The poses at these times."""
        return Mocap(lambda at: _taken(self.world_from_rig, at), lambda at: _taken(self.world_from_target, at))

    def brightness(self) -> Iterator[NDArray[np.uint8]]:
        """The images (H, W), the brightest of their colours."""
        for path in self.images:
            image = read_picture(path)
            if image is None:
                raise BadFile(f"{path} is no image", fix="collect it again, or take it and its line of poses out")
            yield np.asarray(image.max(axis=2) if image.ndim == 3 else image, np.uint8)


def is_collected(folder: Path) -> bool:
    """Whether a folder holds such a set."""
    return (folder / RIG).is_file()


def load_collected(folder: Path, camera: str | None) -> Collected:
    """Load a set: `rig_0_poses.txt`, another file of poses, and for each camera a folder of images named by time.

    Args:
        folder: of the set.
        camera: name of the folder of images; needed where there are several.

    Raises:
        NotFound: there is no such camera, or no target. BadFile: a line is no pose, or counts differ.
    """
    targets = [file for file in sorted(folder.glob("*_poses.txt")) if file.name != RIG]
    if len(targets) != 1:
        raise NotFound(f"{folder} has {len(targets)} files of a target's poses", fix="one, as wand_poses.txt")
    images = _images(folder, camera)
    world_from_rig, _ = _poses(folder / RIG)
    world_from_target, seen = _poses(targets[0])
    if not len(images) == len(world_from_rig) == len(world_from_target):
        raise BadFile(
            f"{folder}: {len(images)} images, {len(world_from_rig)} poses of the rig, {len(world_from_target)} of the "
            "target",
            fix="a line of poses for each image",
        )
    return Collected(
        images, world_from_rig, world_from_target, np.median(moved(inverse(world_from_target), seen), axis=0)
    )


def _images(folder: Path, camera: str | None) -> tuple[Path, ...]:
    cameras = sorted(each.name for each in folder.iterdir() if each.is_dir() and any(each.glob("*.png")))
    if camera is None and len(cameras) != 1:
        raise BadInput(f"{folder} has {len(cameras)} cameras: {', '.join(cameras)}", fix="--camera NAME, one of them")
    if camera is not None and camera not in cameras:
        raise NotFound(f"{folder} has no camera {camera!r}", fix=f"one of {', '.join(cameras)}")
    found = list((folder / (camera or cameras[0])).glob("*.png"))
    if wrong := [path for path in found if not path.stem.isdecimal()]:
        raise BadFile(f"{wrong[0]} is not named by its time", fix="nanoseconds.png")
    return tuple(sorted(found, key=lambda path: int(path.stem)))


def _poses(path: Path) -> tuple[F8, F8]:
    """Poses (F, 4, 4), and places of the markers in the world (F, M, 3)."""
    numbers: list[list[float]] = []
    markers: list[list[list[float]]] = []
    for number, line in enumerate(path.read_text(errors="replace").splitlines(), 1):
        head, _, rest = line.partition("|")
        try:
            row = [float(word) for word in head.split()[1:]]
            places = [[float(word) for word in words.split()] for _, words in MARKER.findall(rest)]
        except ValueError:
            row, places = [], []
        if len(row) != 7 or not np.isfinite(row).all() or any(len(place) != 3 for place in places):
            raise BadFile(f"{path}, line {number}: {line[:60]!r} is no pose", fix=LINE)
        if abs(np.linalg.norm(row[3:]) - 1) > 0.01 or (markers and len(places) != len(markers[0])):
            raise BadFile(f"{path}, line {number}: its quaternion or its count of markers is wrong", fix=LINE)
        numbers.append(row)
        markers.append(places)
    if not numbers:
        raise BadFile(f"{path} is empty", fix=LINE)
    poses = np.array(numbers)
    return pose(Rotation.from_quat(poses[:, 3:]).as_matrix(), poses[:, :3]), np.array(markers)


def _taken(poses: F8, at: F8) -> tuple[F8, NDArray[np.bool_]]:
    index = np.rint(at).astype(np.int64)
    known = (index >= 0) & (index < len(poses))
    return poses[np.clip(index, 0, len(poses) - 1)], known
