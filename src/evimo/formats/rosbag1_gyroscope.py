"""The gyroscope of a ROS 1 bag: sensor_msgs/Imu."""

import struct
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from evimo.errors import BadFile
from evimo.events.gyroscope import Gyroscope, gyroscope_of
from evimo.formats.bag_records import Bag

IMU = "sensor_msgs/Imu"
STAMP_AT, NAME_SIZE_AT, FIELDS_AT = 4, 12, 16
RATE_AT = 13 * 8  # after orientation (4) and its covariance (9)


class ImuSample(NamedTuple):
    """A message's stamp, and its angular velocity in rad/s."""

    stamp_ns: int
    rate: tuple[float, float, float]


def bag_gyroscope(bag: Bag, events: int, clock: Callable[[int], int]) -> Gyroscope | None:
    """The gyroscope next to the connection of the events: of its namespace, else that with the most messages.

    `clock` turns a stamp in ns into µs in the events' clock. Messages that say that they have no angular velocity
    (their covariance begins with -1) are left out.

    Raises:
        BadFile: a message is damaged.
    """
    near = bag.connections[events].topic.rpartition("/")[0]
    names = [name for name, connection in bag.connections.items() if connection.kind == IMU and bag.count(name)]
    if not names:
        return None
    chosen = max(names, key=lambda name: (bag.connections[name].topic.rpartition("/")[0] == near, bag.count(name)))
    topic = bag.connections[chosen].topic
    samples: list[ImuSample] = []
    for chunk in (chunk for chunk in bag.chunks if chunk.counts.get(chosen)):
        for message in bag.messages(chunk, {chosen}):
            try:
                sample = imu_sample(message.payload)
            except struct.error as error:
                raise BadFile(f"{bag.path.name}: a message of {topic} is damaged", fix="copy it again") from error
            if sample:
                samples.append(sample)
    t_us = np.array([clock(sample.stamp_ns) for sample in samples], np.int64)
    rate = np.array([sample.rate for sample in samples], np.float64).reshape(-1, 3)
    return gyroscope_of(t_us, rate, in_camera_axes=False, source=f"{topic} in the bag")


def imu_sample(payload: memoryview) -> ImuSample | None:
    """Take a message apart; None where it says that there is no angular velocity."""
    seconds, nanoseconds, size = struct.unpack_from("<III", payload, STAMP_AT)
    x, y, z, covariance = struct.unpack_from("<4d", payload, FIELDS_AT + size + RATE_AT)
    return None if covariance == -1 else ImuSample(seconds * 10**9 + nanoseconds, (x, y, z))
