"""ROS event messages to events: dvs_msgs/EventArray and event_camera_msgs/EventPacket, as ROS 1 serialises them."""

import struct
from typing import NamedTuple, Protocol

import numpy as np

from evimo.errors import BadFile
from evimo.events.events import Events
from evimo.formats.event_message_kernel import (
    decode_dvs_msgs,
    decode_evt3,
    decode_libcaer,
    decode_mono,
    evt3_state,
)

ARRAYS = ("dvs_msgs/EventArray", "prophesee_event_msgs/EventArray")
PACKETS = ("event_camera_msgs/EventPacket", "event_array_msgs/EventArray")
ENCODINGS = ("evt3", "mono", "libcaer")


class Decoder(Protocol):
    """Decodes the messages of one topic in order."""

    def __call__(self, payload: memoryview, expected_us: int) -> Events:
        """The events of a message; expected_us is about the time of the last, for clocks that wrap."""
        ...


class EventPacket(NamedTuple):
    """An event_camera_msgs/EventPacket: (height, width), what its times are relative to, and how events are packed."""

    size: tuple[int, int]
    base_ns: int
    encoding: str
    events: memoryview


def image_size(payload: memoryview) -> tuple[int, int]:
    """(height, width): the first fields after the header in every event message."""
    height, width = struct.unpack_from("<II", payload, _after_header(payload))
    return height, width


def array_events(payload: memoryview, expected_us: int = 0) -> Events:
    """The events of a dvs_msgs/EventArray; their stamps are whole."""
    at = _after_header(payload) + 12
    return Events(*decode_dvs_msgs(np.frombuffer(payload[at:], np.uint8)))


class PacketDecoder:
    """Decodes event_camera_msgs/EventPacket; EVT3 carries its state from one message to the next.

    EVT3 times are the sensor's own clock; the other encodings are absolute.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._evt3 = None

    def __call__(self, payload: memoryview, expected_us: int = 0) -> Events:
        """The events of one message.

        Raises:
            BadFile: another encoding.
        """
        return self.decoded(packet(payload), expected_us)

    def decoded(self, message: EventPacket, expected_us: int = 0) -> Events:
        """The events of a message that is taken apart already."""
        if message.encoding == "evt3":
            if self._evt3 is None:
                self._evt3 = evt3_state(expected_us)
            whole = len(message.events) // 2 * 2
            return Events(*decode_evt3(np.frombuffer(message.events[:whole], "<u2"), self._evt3))
        raw = np.frombuffer(message.events, np.uint8)
        if message.encoding == "mono":
            return Events(*decode_mono(raw, message.base_ns))
        if message.encoding == "libcaer":
            return Events(*decode_libcaer(raw, message.base_ns))
        raise BadFile(
            f"{self._name}: event messages in the encoding {message.encoding!r} are not supported yet",
            fix=f"record with one of: {', '.join(ENCODINGS)}",
        )


def packet(payload: memoryview) -> EventPacket:
    """Take a ROS 1 EventPacket apart, without copying its events."""
    at = _after_header(payload)
    height, width, _, base_ns, size = struct.unpack_from("<IIQQI", payload, at)
    at += 28
    encoding = bytes(payload[at : at + size]).decode()
    at += size
    big_endian, size = struct.unpack_from("<?I", payload, at)
    if big_endian:
        encoding += " (big-endian)"
    return EventPacket((height, width), base_ns, encoding, payload[at + 5 : at + 5 + size])


def _after_header(payload: memoryview) -> int:
    """Where the fields after std_msgs/Header begin: seq, stamp (8 bytes), frame_id."""
    return 16 + struct.unpack_from("<I", payload, 12)[0]
