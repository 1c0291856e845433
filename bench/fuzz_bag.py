"""A bag of EV-IMO's first version, with motion capture's poses and its three text files, to be damaged by `fuzz.py`."""

import struct
from pathlib import Path

import numpy as np
from bag_files import array
from rosbags.rosbag1 import Writer

from evimo.events.events import Events

RIG, CAR = "DVS346", "Object_1"
STEP_US, PART = 5_000, 400
SLOWER, LATER_US, MARGIN_US = 4, 10_000_000, 100_000  # instants with truth begin at 0.2 s


def bag_files(folder: Path, events: Events) -> dict[str, bytes]:
    """The bag and what lies beside it: the rig moves to the side, and an object before it to the other."""
    events = Events(events.x, events.y, SLOWER * events.t + LATER_US, events.p)
    messages = [
        (int(part.t[0]), "/dvs/events", array(part, cdr=False))
        for part in (events.part(first, first + PART) for first in range(0, len(events), PART))
    ]
    for t in range(int(events.t[0]) - MARGIN_US, int(events.t[-1]) + MARGIN_US, STEP_US):
        messages.append((t, f"/vicon/{RIG}", _subject(t, RIG, (1e-7 * t, 0, 0))))
        messages.append((t, f"/vicon/{CAR}", _subject(t, CAR, (-3e-7 * t, 0, 1))))
    with Writer(folder / "seq_00.bag") as writer:
        topics = {}
        for t, topic, payload in sorted(messages):
            kind = "dvs_msgs/msg/EventArray" if topic == "/dvs/events" else "vicon/msg/Subject"
            if topic not in topics:
                topics[topic] = writer.add_connection(topic, kind, msgdef="string s\n", md5sum="0" * 32)
            writer.write(topics[topic], 1000 * t + 1, payload)
    return {
        "seq_00.bag": (folder / "seq_00.bag").read_bytes(),
        "calib.txt": b"30 30 15.5 11.5 0 0 0 0",
        "extrinsics.txt": b"0.05 -0.02 0.01 0.3 -0.2 0.1\n0 0 0 1 0 0 0\n0.012\n0\n",
        "config.txt": b"true\nfalse\nfalse\n",
    }


def _subject(t: int, name: str, place: tuple[float, float, float]) -> bytes:
    """A vicon/Subject that is not turned."""
    words = b"".join(struct.pack("<I", len(word)) + word.encode() for word in ("/vicon", name))
    stamp = struct.pack("<II", t // 1_000_000, t % 1_000_000 * 1000)
    return struct.pack("<I", 1) + stamp + words + bytes(1) + np.array((*place, 0, 0, 0, 1), "<f8").tobytes() + bytes(4)
