"""EV-IMO's bags: events and the mocap's poses, without maps; what their own program made of the poses, without it.

Beside the bag lie config.txt, calib.txt and extrinsics.txt. Times and poses become what that program gave them, which
is what its releases as .npz and text hold: events from the first one on, poses shifted by the offset that was tuned.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile
from evimo.formats.bag_bodies import body_samples, body_topics
from evimo.formats.bag_messages import Topic, topics
from evimo.formats.event_messages import ARRAYS
from evimo.formats.opening import open_events
from evimo.formats.rosbag1 import Rosbag1
from evimo.formats.rosbag1 import open_bag as open_rosbag
from evimo.geometry.rotations import inverse_poses, matrices_of_angles, matrices_of_quaternions, poses_of
from evimo.recordings.dataset_cameras import RENDERED, camera_of
from evimo.recordings.dataset_maps import NoMaps
from evimo.recordings.datasets import DatasetParts
from evimo.recordings.paths import Paths, paths_of
from evimo.recordings.pose_words import V1_FROM_CAM, in_own_axes

F8 = NDArray[np.float64]
RIG, OBJECTS = "/vicon/DVS346", {1: "/vicon/Object_1", 2: "/vicon/Object_2", 3: "/vicon/Object_3"}
FRAME_US, FIRST_US = 25_000, 200_000  # of the dataset's own frames
NEAR_FRAMES = 2  # gaps of poses of up to 50 ms are bridged
COPY = "copy the whole folder of the recording from the dataset"


@dataclass(frozen=True, slots=True)
class _Body:
    """A body's poses as tracked: world_from_body (N, 4, 4), NaN where there is no rotation, and whether it was seen."""

    times_us: NDArray[np.int64]
    world_from_body: F8
    seen: NDArray[np.bool_]


def open_bag(path: Path) -> tuple[DatasetParts, Paths]:
    """Read the poses of a bag of EV-IMO's first version; its instants are every 25 ms from 0.2 s on.

    Raises:
        BadFile: a file beside it is missing or damaged, or the bag holds no poses of the camera.
    """
    bag = open_rosbag(path)
    if RIG not in {topic.name for topic in body_topics(bag)}:
        held = ", ".join(topic.name for topic in topics(bag))
        raise BadFile(f"{path} holds no poses of the camera ({RIG}), only {held[:200]}", fix="a bag of EV-IMO")
    lens = _numbers(path.with_name("calib.txt"), 0, 8)
    extrinsics = path.with_name("extrinsics.txt")
    x, y, z, *angles = _numbers(extrinsics, 0, 6)
    offset_us = round(_numbers(extrinsics, 2, 1)[0] * 1e6)
    names = ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4")
    events = open_events(path)
    camera = camera_of(dict(zip(names, lens, strict=True)), events.sensor, RENDERED, str(path.with_name("calib.txt")))
    rig_from_cam = poses_of(np.array([x, y, z]), matrices_of_angles(np.array(angles)))
    origin_us = _first_message_us(bag) - events.start_us - offset_us
    rig, objects = _tracked(bag, path, origin_us)
    paths = _paths(rig, objects, rig_from_cam)
    numbers = _near_poses(rig.times_us - (events.start_us + FIRST_US))
    times = events.start_us + FIRST_US + FRAME_US * numbers
    numbers, times = numbers[times < events.stop_us], times[times < events.stop_us]
    exact = paths.motions(times)
    known = np.isfinite(exact["ego"]).all(axis=1)
    if not known.any():
        raise BadFile(f"{path}: no pose of the camera is of the events' time", fix=COPY)
    cut = {name: values if name == "object_ids" else values[known] for name, values in exact.items()}
    return DatasetParts(path, NoMaps(camera.size), numbers[known], camera, cut), paths


def _near_poses(since_us: NDArray[np.int64]) -> NDArray[np.int64]:
    """Numbers of the frames that lie near poses: of others nothing is known, however long a recording says it is."""
    near = np.unique(since_us // FRAME_US)
    near = np.unique(near[:, None] + np.arange(-NEAR_FRAMES, NEAR_FRAMES + 2))
    return near[near >= 0]


def _first_message_us(bag: Rosbag1) -> int:
    """When the recorder received the first message with events: the dataset's program calls that moment the first
    event's.
    """
    found = topics(bag, ARRAYS)
    return next(iter(bag.messages(found[0].connections))).time_ns // 1000


def _tracked(bag: Rosbag1, path: Path, origin_us: int) -> tuple[_Body, dict[int, _Body]]:
    """The rig, and the objects that config.txt enables, in the events' clock."""
    config = path.with_name("config.txt")
    if not config.exists():
        raise BadFile(f"{path.parent} lacks config.txt", fix=COPY)
    enabled = [word == "true" for word in config.read_text(errors="replace").lower().split()]
    found = {topic.name: topic for topic in body_topics(bag)}
    objects: dict[int, _Body] = {}
    for key, name in OBJECTS.items():
        if enabled[key - 1 : key] == [True]:
            if name not in found:
                raise BadFile(f"{config} enables object {key}, of which the bag has no poses", fix=COPY)
            objects[key] = _body(bag, found[name], origin_us)
    return _body(bag, found[RIG], origin_us), objects


def _body(bag: Rosbag1, topic: Topic, origin_us: int) -> _Body:
    samples = [(each.stamp_ns, each.tracked, each.pose) for each in body_samples(bag, topic, markers=False)]
    times_us = np.array([stamp_ns for stamp_ns, _, _ in samples], np.int64) // 1000 - origin_us
    poses = np.array([pose for _, _, pose in samples], np.float64).reshape(-1, 7)
    rotations = matrices_of_quaternions(poses[:, [6, 3, 4, 5]])  # messages hold x y z w
    return _Body(times_us, poses_of(poses[:, :3], rotations), np.array([seen for _, seen, _ in samples], np.bool_))


def _paths(rig: _Body, objects: dict[int, _Body], rig_from_cam: F8) -> Paths:
    """Splines in this package's axes; occluded samples of objects are not known, those of the camera are kept."""
    times = np.unique(rig.times_us)
    world_from_cam = rig.world_from_body @ rig_from_cam
    own, _ = in_own_axes(world_from_cam, {})
    base = paths_of(rig.times_us, own, {})
    at_times = base.camera.at(times)
    world_from_cam = np.where(at_times.valid[:, None, None], at_times.world_from_body, np.nan)
    placed: dict[int, F8] = {}
    for key, poses in objects.items():
        seen = poses.seen
        path = paths_of(poses.times_us[seen], V1_FROM_CAM.T @ poses.world_from_body[seen], {}).camera.at(times)
        world_from_object = np.where(path.valid[:, None, None], path.world_from_body, np.nan)
        placed[key] = inverse_poses(world_from_cam) @ world_from_object
    return paths_of(times, world_from_cam, placed)


def _numbers(path: Path, line: int, least: int) -> list[float]:
    """The numbers of one line of a text file.

    Raises:
        BadFile: there is no such file or line, or too few numbers in it.
    """
    if not path.exists():
        raise BadFile(f"{path.parent} lacks {path.name}", fix=COPY)
    lines = path.read_text(errors="replace").splitlines()
    try:
        numbers = [float(word) for word in lines[line].split()]
    except (IndexError, ValueError):
        numbers = []
    if len(numbers) < least or not np.isfinite(numbers).all():
        raise BadFile(f"{path}, line {line + 1}: {least} numbers should be here", fix=COPY)
    return numbers[:least]
