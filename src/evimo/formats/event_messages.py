"""Event messages of ROS 1 and ROS 2 to events: dvs_msgs/EventArray and event_camera_msgs/EventPacket."""

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile
from evimo.events.events import Events, no_events
from evimo.formats.bag_messages import MessageFields
from evimo.formats.event_message_kernel import (
    CDR_EVENT,
    CDR_SOONER,
    CDR_STEP,
    EVENT,
    LIBCAER,
    MONO,
    decode_dvs_msgs,
    decode_libcaer,
    decode_mono,
)
from evimo.formats.evt3_messages import Evt3Messages
from evimo.formats.libcaer_cmp_kernel import decode_libcaer_cmp

ARRAYS = ("dvs_msgs/EventArray", "prophesee_event_msgs/EventArray")
PACKETS = ("event_camera_msgs/EventPacket", "event_array_msgs/EventArray")
ENCODINGS = ("evt3", "mono", "libcaer", "libcaer_cmp")
WORD = np.dtype("<u2")


class Decoder(Protocol):
    """Decodes the messages of one topic in order."""

    def __call__(self, payload: memoryview, expected_us: int) -> Events:
        """The events of a message, less those that wait for more; expected_us is about the time of the last, or 0."""
        ...

    def rest(self) -> Events:
        """The events that still wait, after the last message."""
        ...


class EventPacket(NamedTuple):
    """An event_camera_msgs/EventPacket: (height, width), what its times are relative to, and how events are packed."""

    size: tuple[int, int]
    base_ns: int
    encoding: str
    events: memoryview


def decoder_of(kind: str, name: str, *, cdr: bool) -> Decoder:
    """A decoder for one topic's kind of message; `name` is the file's, for errors."""
    return ArrayDecoder(cdr=cdr) if kind in ARRAYS else PacketDecoder(name, cdr=cdr)


def image_size(payload: memoryview, *, cdr: bool) -> tuple[int, int]:
    """(height, width): the first fields after the header in every event message."""
    fields = MessageFields(payload, cdr=cdr)
    fields.stamp_ns()
    height, width = fields.numbers("2I")
    return height, width


class ArrayDecoder:
    """Decodes dvs_msgs/EventArray; the stamps of its events are whole."""

    def __init__(self, *, cdr: bool = False) -> None:
        self._cdr = cdr

    def __call__(self, payload: memoryview, expected_us: int = 0) -> Events:
        """The events of one message."""
        fields = MessageFields(payload, cdr=self._cdr)
        fields.stamp_ns()
        _, _, count = fields.numbers("3I")
        raw, item = fields.rest(), CDR_STEP if self._cdr else EVENT.itemsize
        if count and (count - 1) * item + EVENT.itemsize > len(raw):
            raise ValueError(f"it ends before its {count} events do")
        if not self._cdr or not count:
            return Events(*decode_dvs_msgs(np.frombuffer(raw, EVENT, count)))
        first = len(payload) - len(raw) - CDR_SOONER  # there is more before: the number of events
        events = Events(*decode_dvs_msgs(np.ndarray(count, CDR_EVENT, payload, first, CDR_STEP)))
        events.x[0], events.y[0] = np.frombuffer(raw, np.uint16, 2)
        return events

    def rest(self) -> Events:
        """None ever wait."""
        return no_events()


class PacketDecoder:
    """Decodes event_camera_msgs/EventPacket; of EVT3, the last words of a message wait for those of the next.

    EVT3 times are the sensor's own clock; the other encodings are absolute.
    """

    def __init__(self, name: str, *, cdr: bool = False) -> None:
        self._name, self._cdr = name, cdr
        self._evt3 = Evt3Messages()

    def __call__(self, payload: memoryview, expected_us: int = 0) -> Events:
        """The events of one message.

        Raises:
            BadFile: another encoding.
        """
        return self.decoded(packet(payload, cdr=self._cdr), expected_us)

    def decoded(self, message: EventPacket, expected_us: int = 0) -> Events:
        """The events of a message that is taken apart already."""
        if message.encoding in ("evt3", "libcaer_cmp"):
            words = _records(message.events, WORD)
            if message.encoding == "libcaer_cmp":
                return Events(*decode_libcaer_cmp(words, message.base_ns))
            return self._evt3(words, expected_us)
        if message.encoding == "mono":
            return Events(*decode_mono(_records(message.events, MONO), message.base_ns))
        if message.encoding == "libcaer":
            return Events(*decode_libcaer(_records(message.events, LIBCAER), message.base_ns))
        raise BadFile(
            f"{self._name}: event messages in the encoding {message.encoding!r} are not supported yet",
            fix=f"record with one of: {', '.join(ENCODINGS)}",
        )

    def rest(self) -> Events:
        """The events that still wait, after the last message."""
        return self._evt3.rest()


def packet(payload: memoryview, *, cdr: bool) -> EventPacket:
    """Take an EventPacket apart, without copying its events."""
    fields = MessageFields(payload, cdr=cdr)
    fields.stamp_ns()
    height, width = fields.numbers("2I")
    _, base_ns = fields.numbers("2Q")
    if base_ns >> 62:
        raise ValueError(f"its times begin at {base_ns} ns")
    encoding = fields.text()
    if fields.numbers("B")[0]:
        encoding += " (big-endian)"
    return EventPacket((height, width), base_ns, encoding, fields.block())


def _records(raw: memoryview, kind: np.dtype[Any]) -> NDArray[Any]:
    """Bytes as an array of one kind, without what is left over."""
    return np.frombuffer(raw, kind, len(raw) // kind.itemsize)
