"""The gyroscope of a bag: sensor_msgs/Imu."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from evimo.events.gyroscope import Gyroscope, gyroscope_of
from evimo.formats.bag_messages import Bag, MessageFields, Topic, topics
from evimo.formats.bag_topics import DAMAGED, damaged

IMU = "sensor_msgs/Imu"


class ImuSample(NamedTuple):
    """A message's stamp, and its angular velocity in rad/s."""

    stamp_ns: int
    rate: tuple[float, ...]


def bag_gyroscope(bag: Bag, events: Topic, clock: Callable[[int], int]) -> Gyroscope | None:
    """The gyroscope next to the topic of the events: of its namespace, else that with the most messages.

    `clock` turns a stamp in ns into µs in the events' clock. Messages that say that they have no angular velocity
    (their covariance begins with -1) are left out.

    Raises:
        BadFile: a message is damaged.
    """
    found = topics(bag, (IMU,))
    if not found:
        return None
    chosen = max(found, key=lambda topic: (topic.namespace == events.namespace, topic.messages))
    samples: list[ImuSample] = []
    for message in bag.messages(chosen.connections):
        try:
            sample = imu_sample(message.payload, cdr=bag.cdr)
        except DAMAGED as error:
            raise damaged(bag, chosen, error) from error
        if sample:
            samples.append(sample)
    t_us = np.array([clock(sample.stamp_ns) for sample in samples], np.int64)
    rate = np.array([sample.rate for sample in samples], np.float64).reshape(-1, 3)
    return gyroscope_of(t_us, rate, in_camera_axes=False, source=f"{chosen.name} in the bag")


def imu_sample(payload: memoryview, *, cdr: bool) -> ImuSample | None:
    """Take a message apart; None where it says that there is no angular velocity."""
    fields = MessageFields(payload, cdr=cdr)
    stamp_ns = fields.stamp_ns()
    fields.numbers("13d")  # the orientation (4) and its covariance (9)
    *rate, covariance = fields.numbers("4d")
    return None if covariance == -1 else ImuSample(stamp_ns, tuple(rate))
