"""Bags of ROS 1 and ROS 2 with events: dvs_msgs, prophesee_event_msgs, event_camera_msgs."""

import warnings
from pathlib import Path

from evimo.errors import BadFile, EvimoWarning
from evimo.formats.bag_camera import bag_camera
from evimo.formats.bag_gyroscope import bag_gyroscope
from evimo.formats.bag_messages import Bag, topics
from evimo.formats.bag_topics import event_topic
from evimo.formats.event_file import EventFile
from evimo.formats.event_messages import ARRAYS, PACKETS

CONTENTS = {
    "frames": ("Image", "CompressedImage"),
    "IMU": ("Imu",),
    "poses": ("Subject", "PoseStamped", "TransformStamped", "Odometry", "PoseWithCovarianceStamped"),
    "camera info": ("CameraInfo",),
}


def open_rosbag1(path: Path, sensor: tuple[int, int] | None = None, topic: str | None = None) -> EventFile:
    """Open the events of a ROS 1 bag.

    Times are the events' own: absolute, but the sensor's clock in the encoding evt3.

    Raises:
        BadFile: no topic with events, an unknown encoding, or nothing readable.
        NotFound: no events on that topic.
    """
    from evimo.formats.rosbag1 import open_bag

    return _opened(open_bag(path), sensor, topic)


def open_rosbag2(path: Path, sensor: tuple[int, int] | None = None, topic: str | None = None) -> EventFile:
    """Open the events of a ROS 2 bag, a folder or one of its files, as those of a ROS 1 bag."""
    from evimo.formats.rosbag2 import open_bag

    return _opened(open_bag(path), sensor, topic)


def _opened(bag: Bag, sensor: tuple[int, int] | None, name: str | None) -> EventFile:
    found = event_topic(bag, name).compared()
    first = next(filter(len, found.packets()))
    size = sensor or found.size()
    if min(size) < 1:
        raise BadFile(f"{bag.path.name} does not tell its sensor's size", fix="give it with --sensor WxH")
    if bag.damage:
        warnings.warn(f"{bag.path.name} {bag.damage}; was it cut short?", EvimoWarning, stacklevel=4)
    return EventFile(
        path=bag.path,
        format=f"{bag.title} ({found.topic.kind})",
        sensor=size,
        start_us=int(first.t.min()),
        stop_us=found.stop_us(),
        read=found.read,
        camera=bag_camera(bag, found.topic, size),
        read_gyroscope=lambda: bag_gyroscope(bag, found.topic, found.of_stamp),
        contents=_contents(bag),
        topic=found.topic.name,
    )


def _contents(bag: Bag) -> dict[str, str]:
    """What is in the bag: name to topics with their numbers of messages."""
    contents: dict[str, list[str]] = {}
    for topic in topics(bag):
        kind = topic.kind.rpartition("/")[2]
        words = next((words for words, kinds in CONTENTS.items() if kind in kinds), "other")
        words = "event topics" if topic.kind in ARRAYS + PACKETS else words
        contents.setdefault(words, []).append(f"{topic.name} ({topic.messages:,})")
    return {words: ", ".join(names) for words, names in contents.items()}
