"""The events of one topic of a bag: chosen among several, and read in order, their clock beside the recorder's."""

import struct
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace

from evimo.errors import BadFile, EvimoWarning, NotFound
from evimo.events.events import Events, joined
from evimo.formats.bag_messages import SECOND_NS, Bag, Topic, topics
from evimo.formats.damage import marred
from evimo.formats.event_messages import ARRAYS, PACKETS, Decoder, decoder_of, image_size
from evimo.formats.survey import no_events_in

MARGIN_US = 1_000_000  # between an event and the recording of its message
DRIFT = 1e-4  # of the sensor's clock against the recorder's
SAME_CLOCK_US = 60_000_000  # a sensor's own clock differs from the recorder's by years
PACKET_BYTES = 1 << 18  # messages are joined into packets of about so much
DAMAGED = (struct.error, ValueError, IndexError)


@dataclass(frozen=True, slots=True)
class EventTopic:
    """The events of one topic of a bag.

    clocks_us: a message's time by the recorder, and of its last event by the sensor.
    """

    bag: Bag
    topic: Topic
    clocks_us: tuple[int, int] = (0, 0)

    def expected_us(self, recorded_ns: int) -> int:
        """About the sensor's time at a time of the recorder."""
        recorded_us, event_us = self.clocks_us
        return event_us + recorded_ns // 1000 - recorded_us

    def of_stamp(self, stamp_ns: int) -> int:
        """The events' time at another message's stamp, which events share unless they are in the sensor's own clock."""
        recorded_us, event_us = self.clocks_us
        return stamp_ns // 1000 if abs(recorded_us - event_us) < SAME_CLOCK_US else self.expected_us(stamp_ns)

    def compared(self) -> "EventTopic":
        """The same with its clocks compared at the first message that has events.

        Raises:
            BadFile: none has, or all are damaged.
        """
        why = None
        for message in self.bag.messages(self.topic.connections):
            decode = self.decoder()
            try:
                events = joined([decode(message.payload, 0), decode.rest()])
            except DAMAGED as error:
                why = error
            else:
                if len(events):
                    return replace(self, clocks_us=(message.time_ns // 1000, int(events.t.max())))
        raise damaged(self.bag, self.topic, why) if why else no_events_in(self.bag.path)

    def decoder(self) -> Decoder:
        """A decoder for this topic's kind of message."""
        return decoder_of(self.topic.kind, self.bag.path.name, cdr=self.bag.cdr)

    def size(self) -> tuple[int, int]:
        """(height, width) as the first whole message tells it."""
        for message in self.bag.messages(self.topic.connections):
            try:
                return image_size(message.payload, cdr=self.bag.cdr)
            except DAMAGED:
                continue
        raise no_events_in(self.bag.path)

    def packets(self, start_ns: int | None = None) -> Iterator[Events]:
        """Packets of about a quarter of a megabyte of messages, of all that was recorded from start_ns on.

        They may begin sooner. Messages that are damaged are left out; a warning at the end says how many.
        """
        decode, waiting, size, bad = self.decoder(), list[Events](), 0, 0
        for message in self.bag.messages(self.topic.connections, start_ns):
            try:
                waiting.append(decode(message.payload, self.expected_us(message.time_ns)))
            except DAMAGED:
                bad += 1
            size += len(message.payload)
            if size >= PACKET_BYTES:
                yield marred(waiting)
                waiting, size = [], 0
        yield marred([*waiting, decode.rest()])
        if bad:
            text = f"{self.bag.path.name}: {bad:,} messages of {self.topic.name} are damaged and left out"
            warnings.warn(text, EvimoWarning, stacklevel=3)

    def read(self, start_us: int) -> Iterator[Events]:
        """Packets from a place on before which all was recorded before start_us."""
        recorded_us, event_us = self.clocks_us
        elapsed = start_us - event_us
        return self.packets((recorded_us + elapsed - MARGIN_US - int(abs(elapsed) * DRIFT)) * 1000)

    def stop_us(self) -> int:
        """The time of the last event + 1, from ever more of the end until it holds events."""
        stop_ns, back = self.bag.stop_ns, SECOND_NS // 10
        while True:
            whole = stop_ns - back <= self.clocks_us[0] * 1000
            found = [int(events.t.max()) for events in self.packets(None if whole else stop_ns - back) if len(events)]
            if found or whole:
                return max(found, default=self.clocks_us[1]) + 1
            back *= 8


def damaged(bag: Bag, topic: Topic, why: Exception) -> BadFile:
    """The error for a message that does not hold what its kind says."""
    return BadFile(f"{bag.path.name}: a message of {topic.name} is damaged ({why})", fix="copy it again")


def event_topic(bag: Bag, name: str | None) -> EventTopic:
    """The topic of that name; without a name the first, by name, of those with at least half as many messages as any.

    A stereo bag so gives its left camera rather than its right one, and its first rather than its second; a warning
    says so, and how to choose.

    Raises:
        BadFile: there are no event messages.
        NotFound: none on that topic.
    """
    found = topics(bag, ARRAYS + PACKETS)
    if not found:
        held = ", ".join(dict.fromkeys(topic.name for topic in topics(bag))) or "nothing"
        raise BadFile(
            f"{bag.path.name} holds no event messages, only {held[:300]}",
            fix=f"give a bag with one of: {', '.join(ARRAYS + PACKETS)}",
        )
    if name is not None:
        return EventTopic(bag, _named(bag, found, name))
    most = max(topic.messages for topic in found)
    chosen = next(topic for topic in found if 2 * topic.messages >= most)
    if others := [topic.name for topic in found if topic is not chosen]:
        text = (
            f"{bag.path.name} has {len(found)} topics with events: {chosen.name} is read, not {', '.join(others)}; "
            "--topic NAME chooses"
        )
        warnings.warn(text, EvimoWarning, stacklevel=4)
    return EventTopic(bag, chosen)


def _named(bag: Bag, found: list[Topic], name: str) -> Topic:
    for topic in found:
        if topic.name.strip("/") == name.strip("/"):
            return topic
    listed = ", ".join(f"{topic.name} ({topic.messages:,} messages)" for topic in found)
    raise NotFound(f"{bag.path.name} has no events on the topic {name}", fix=f"one of: {listed}")
