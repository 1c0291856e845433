"""Small captures in every form that motion capture comes in, written by other programs' writers where there are any."""

import struct

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

BODIES = {"Rig": 0, "Object_1": 1}


@pytest.fixture
def poses():
    """Times in µs, positions and quaternions x y z w of each body, and when it was tracked."""
    rng = np.random.default_rng(4)
    times_us = 1_600_000_000_000_000 + 5_000 * np.arange(40)
    found = {}
    for body in BODIES:
        quaternion = Rotation.random(40, rng=rng).as_quat()
        found[body] = (times_us, rng.normal(size=(40, 3)), quaternion, rng.random(40) > 0.2)
    return found


def packed(word):
    return struct.pack("<I", len(word)) + word.encode()


@pytest.fixture
def vicon_bag():
    """Writes a ROS 1 bag of vicon/Subject, by the writer of the rosbags library."""
    from rosbags.rosbag1 import Writer

    def write(path, poses, markers=None):
        with Writer(path) as writer:
            for body, (times_us, position, quaternion, tracked) in poses.items():
                topic = writer.add_connection(
                    f"/vicon/{body}", "vicon/msg/Subject", msgdef="Header header", md5sum="0" * 32
                )
                for k, t_us in enumerate(times_us.tolist()):
                    stamp = struct.pack("<II", t_us // 10**6, t_us % 10**6 * 1000)
                    message = struct.pack("<I", k) + stamp + packed("/world") + packed(body)
                    message += struct.pack("<?7d", not tracked[k], *position[k], *quaternion[k])
                    mine = (markers or {}).get(body, {})
                    message += struct.pack("<I", len(mine))
                    for name, (place, visible) in mine.items():
                        message += packed(name) + packed(body) + struct.pack("<3d?", *place[k], not visible[k])
                    writer.write(topic, t_us * 1000 + 400_000, message)
        return path

    return write
