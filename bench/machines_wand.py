"""Images of a wand of lights and the poses collected with them, which `evimo calibrate` reads in `machines.py`."""

from pathlib import Path

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

F8 = NDArray[np.float64]

LIGHTS = np.array(((0, -0.15, 0), (0, 0, 0), (0, 0.075, 0), (0.12, 0, 0), (0.24, 0, 0)))  # a T
SIZE, FOCAL_PX = (260, 346), 250.0
MATRIX = np.array(((FOCAL_PX, 0, 172.5), (0, FOCAL_PX, 129.5), (0, 0, 1)))


def save_collected(folder: Path, *, images: int) -> Path:
    """As many images, poses of rig and wand for each, and beside the folder a file of the wand and one of the lens."""
    (folder / "cam_0").mkdir(parents=True)
    at = 0.05 * np.arange(images)
    rig_from_cam = _poses(np.array([[1.6, 0.1, -1.5]]), np.array([[0.11, -0.04, 0.03]]))
    world_from_rig = _poses(
        0.1 * np.stack((np.sin(0.7 * at), np.cos(0.4 * at), 2 * np.sin(0.3 * at)), axis=1),
        np.stack((0.3 * np.sin(0.5 * at), 0.1 * np.cos(0.9 * at), 1.2 + 0 * at), axis=1),
    )
    far = 0.9 + 0.4 * np.sin(1.1 * at)
    cam_from_wand = _poses(
        np.stack((0.6 * np.sin(1.3 * at), 0.6 * np.cos(1.7 * at), 1.5 * np.sin(0.8 * at)), axis=1),
        np.stack((0.5 * far * np.sin(1.9 * at), 0.3 * far * np.sin(2.7 * at), far), axis=1),
    )
    world_from_wand = world_from_rig @ rig_from_cam @ cam_from_wand
    for number, pose in enumerate(cam_from_wand):
        cv2.imwrite(str(folder / "cam_0" / f"{number + 1}.png"), _image(pose))
    _save_poses(folder / "rig_0_poses.txt", world_from_rig)
    _save_poses(folder / "wand_poses.txt", world_from_wand)
    lights = {str(number): place for number, place in enumerate(LIGHTS.tolist())}
    wand = {"kind": "wand", "body": "wand", "lights": lights, "markers": lights}
    folder.with_name("wand.yaml").write_text(yaml.safe_dump(wand))
    np.savetxt(folder.with_name("lens.txt"), [MATRIX[(0, 1, 0, 1), (0, 1, 2, 2)]])
    return folder


def _poses(turns: F8, places: F8) -> F8:
    """(N, 4, 4) of rotation vectors and places."""
    poses = np.tile(np.eye(4), (len(turns), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = Rotation.from_rotvec(turns).as_matrix(), places
    return poses


def _image(cam_from_wand: F8) -> NDArray[np.uint8]:
    """Round spots where the lights are."""
    image, scale = np.zeros(SIZE, np.uint8), 16
    points = (LIGHTS @ cam_from_wand[:3, :3].T + cam_from_wand[:3, 3]) @ MATRIX.T
    for x, y in np.rint(scale * points[:, :2] / points[:, 2:]).astype(int).tolist():
        cv2.circle(image, (x, y), 2 * scale, 255, -1, cv2.LINE_AA, 4)
    return image


def _save_poses(path: Path, poses: F8) -> None:
    """A line for each, with the lights as markers where they are in the world."""
    lines: list[str] = []
    for number, pose in enumerate(poses):
        numbers = (*pose[:3, 3], *Rotation.from_matrix(pose[:3, :3]).as_quat())
        markers = LIGHTS @ pose[:3, :3].T + pose[:3, 3]
        words = [f"{{'{k}': '{' '.join(f'{v:.9f}' for v in place)}'}}" for k, place in enumerate(markers)]
        lines.append(" | ".join((f"{number} {' '.join(f'{v:.9f}' for v in numbers)}", *words)))
    path.write_text("\n".join(lines) + "\n")
