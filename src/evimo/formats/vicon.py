"""Poses of bodies that a Vicon system tracked, out of a ROS bag: messages of the kind vicon/Subject."""

import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evimo.errors import NotFound
from evimo.formats.bag_messages import Bag, MessageFields, topics
from evimo.geometry.rotations import matrices_of_quaternions, poses_of

SUBJECT = "vicon/Subject"
DAMAGED = (struct.error, ValueError, IndexError)


@dataclass(frozen=True, slots=True)
class SubjectPoses:
    """A body's poses as tracked.

    stamps_us:       (N,) int64, the tracking computer's clock.
    world_from_body: (N, 4, 4), m; NaN where a message holds no rotation.
    occluded:        (N,) bool, where the system says that it did not see the body.
    """

    stamps_us: NDArray[np.int64]
    world_from_body: NDArray[np.float64]
    occluded: NDArray[np.bool_]


def subject_topics(bag: Bag) -> list[str]:
    """The topics with poses of bodies."""
    return [topic.name for topic in topics(bag, (SUBJECT,))]


def subject_poses(bag: Bag, name: str) -> SubjectPoses:
    """The poses of one body, whole: an hour at 200 Hz is 100 MB. Damaged messages are left out.

    Raises:
        NotFound: there is no such topic.
    """
    found = {topic.name: topic for topic in topics(bag, (SUBJECT,))}
    if name not in found:
        raise NotFound(f"{bag.path.name} has no poses on {name}", fix=f"one of: {', '.join(found) or 'none'}")
    rows: list[tuple[float, ...]] = []
    for message in bag.messages(found[name].connections):
        try:
            fields = MessageFields(message.payload, cdr=bag.cdr)
            stamp_ns = fields.stamp_ns()
            fields.text()  # the body's name
            (occluded,) = fields.numbers("1B")
            rows.append((stamp_ns, occluded, *fields.numbers("7d")))
        except DAMAGED:
            continue
    stamps = np.array([row[0] for row in rows], np.int64) // 1000
    values = np.array([row[1:] for row in rows], np.float64).reshape(-1, 8)
    rotations = matrices_of_quaternions(values[:, [7, 4, 5, 6]])  # messages hold x y z w
    return SubjectPoses(stamps, poses_of(values[:, 1:4], rotations), values[:, 0] != 0)
