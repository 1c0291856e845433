"""Bodies that motion capture tracks, in bags: vicon/Subject with its markers, and plain stamped poses."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from evimo.formats.bag_messages import Bag, MessageFields, Topic, topics
from evimo.formats.bag_topics import DAMAGED, damaged, event_topic

SUBJECT = "vicon/Subject"
BODY_KINDS = (SUBJECT, "geometry_msgs/PoseStamped", "geometry_msgs/TransformStamped")


class MarkerSample(NamedTuple):
    """One marker in one message: its place in the world, m, which means nothing where it is not visible."""

    name: str
    position: tuple[float, float, float]
    visible: bool


class BodySample(NamedTuple):
    """One message: its stamp, whether the body was tracked, x y z in m and quaternion x y z w, and its markers."""

    stamp_ns: int
    tracked: bool
    pose: tuple[float, ...]
    markers: tuple[MarkerSample, ...]


def open_bag_of(path: Path, *, ros2: bool) -> Bag:
    """Open a bag of ROS 1 or ROS 2.

    Raises:
        BadFile: nothing in it is readable.
    """
    if ros2:
        from evimo.formats.rosbag2 import open_bag as opened
    else:
        from evimo.formats.rosbag1 import open_bag as opened
    return opened(path)


def body_topics(bag: Bag) -> list[Topic]:
    """The topics with poses of bodies, by name; the last word of each is the body's."""
    return topics(bag, BODY_KINDS)


def body_samples(bag: Bag, topic: Topic, *, markers: bool) -> Iterator[BodySample]:
    """All messages of a topic in the order in which they were recorded; markers: whether they are taken along.

    Raises:
        BadFile: a message is damaged.
    """
    for message in bag.messages(topic.connections):
        try:
            yield body_sample(message.payload, topic.kind, cdr=bag.cdr, markers=markers)
        except DAMAGED as error:
            raise damaged(bag, topic, error) from error


def body_sample(payload: memoryview, kind: str, *, cdr: bool, markers: bool) -> BodySample:
    """Take a message apart; one that is too short raises one of DAMAGED."""
    fields = MessageFields(payload, cdr=cdr)
    stamp_ns, tracked = fields.stamp_ns(), True
    if kind == SUBJECT:
        fields.text()  # the subject's name, which is the topic's last word
        tracked = not fields.numbers("?")[0]
    elif kind == "geometry_msgs/TransformStamped":
        fields.text()  # the name of the child frame
    pose = fields.numbers("7d")
    seen = tuple(_markers(fields)) if markers and kind == SUBJECT else ()
    return BodySample(stamp_ns, tracked, pose, seen)


def _markers(fields: MessageFields) -> Iterator[MarkerSample]:
    for _ in range(fields.numbers("I")[0]):
        name = fields.text()
        fields.text()  # the subject's name again
        position = fields.numbers("3d")
        yield MarkerSample(name, position, not fields.numbers("?")[0])


def stamps_to_events(bag: Bag, topic: str | None, stamps_ns: list[int]) -> list[int]:
    """Stamps of messages in ns as µs in the clock of the bag's events: another where these keep the sensor's own.

    Raises:
        BadFile, NotFound: the bag has no events, or none on that topic.
    """
    clock = event_topic(bag, topic).compared().of_stamp
    return [clock(stamp_ns) for stamp_ns in stamps_ns]
