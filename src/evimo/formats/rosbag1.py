"""ROS 1 bags with events: dvs_msgs, prophesee_event_msgs, event_camera_msgs."""

import struct
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from evimo.errors import BadFile, EvimoWarning
from evimo.events.events import Events, joined
from evimo.formats.bag_records import Bag, ChunkPlace, open_bag
from evimo.formats.event_file import EventFile, FoundCamera, found_camera
from evimo.formats.event_messages import ARRAYS, PACKETS, Decoder, PacketDecoder, array_events, image_size
from evimo.formats.rosbag1_gyroscope import bag_gyroscope
from evimo.formats.survey import no_events_in
from evimo.geometry.camera import Camera

MARGIN_US = 1_000_000  # between an event and the recording of its message
DRIFT = 1e-4  # of the sensor's clock against the recorder's
SAME_CLOCK_US = 60_000_000  # a sensor's own clock differs from the recorder's by years
CONTENTS = {
    "frames": ("Image", "CompressedImage"),
    "IMU": ("Imu",),
    "poses": ("Subject", "PoseStamped", "TransformStamped", "Odometry", "PoseWithCovarianceStamped"),
    "camera info": ("CameraInfo",),
}


@dataclass(frozen=True, slots=True)
class EventTopic:
    """The events of one topic of a bag.

    clocks_us: a message's time by the recorder, and of its last event by the sensor.
    """

    bag: Bag
    connection: int
    clocks_us: tuple[int, int] = (0, 0)

    def chunks(self) -> list[ChunkPlace]:
        """The chunks with events."""
        return [chunk for chunk in self.bag.chunks if chunk.counts.get(self.connection)]

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
            BadFile: none has.
        """
        decode = self.decoder()
        for chunk in self.chunks():
            for _, time_ns, payload in self.bag.messages(chunk, {self.connection}):
                if len(events := self._decoded(decode, payload, 0)):
                    return EventTopic(self.bag, self.connection, (time_ns // 1000, int(events.t.max())))
        raise no_events_in(self.bag.path)

    def decoder(self) -> Decoder:
        """A decoder for this topic's kind of message."""
        array = self.bag.connections[self.connection].kind in ARRAYS
        return array_events if array else PacketDecoder(self.bag.path.name)

    def packets(self, chunks: list[ChunkPlace]) -> Iterator[Events]:
        """One packet per chunk."""
        decode = self.decoder()
        for chunk in chunks:
            messages = self.bag.messages(chunk, {self.connection})
            yield joined(
                [self._decoded(decode, payload, self.expected_us(time_ns)) for _, time_ns, payload in messages]
            )

    def _decoded(self, decode: Decoder, payload: memoryview, expected_us: int) -> Events:
        try:
            return decode(payload, expected_us)
        except (struct.error, ValueError) as error:
            topic = self.bag.connections[self.connection].topic
            raise BadFile(f"{self.bag.path.name}: a message of {topic} is damaged", fix="copy it again") from error

    def read(self, start_us: int) -> Iterator[Events]:
        """Packets from a chunk on before which all was recorded before start_us."""
        recorded_us, event_us = self.clocks_us
        elapsed = start_us - event_us
        recorded = recorded_us + elapsed - MARGIN_US - int(abs(elapsed) * DRIFT)
        chunks = self.chunks()
        before = [at for at, chunk in enumerate(chunks) if chunk.stop_ns // 1000 < recorded]
        return self.packets(chunks[before[-1] + 1 if before else 0 :])


def open_rosbag1(path: Path, sensor: tuple[int, int] | None = None) -> EventFile:
    """Open the events of a ROS 1 bag; of several topics with events, the one with the most messages.

    Times are the events' own: absolute, but the sensor's clock in the encoding evt3.

    Raises:
        BadFile: no topic with events, an unknown encoding, or nothing readable.
    """
    bag = open_bag(path)
    topic, size = _event_topic(bag)
    topic = topic.compared()
    first = next(filter(len, topic.packets(topic.chunks())))
    last = next(filter(len, (joined(list(topic.packets([chunk]))) for chunk in reversed(topic.chunks()))))
    if bag.cut_short:
        text = f"{path.name} has lost its index: its {len(bag.chunks):,} readable chunks are used; was it cut short?"
        warnings.warn(text, EvimoWarning, stacklevel=3)
    if sensor is None and min(size) < 1:
        raise BadFile(f"{path.name} does not tell its sensor's size", fix="give it with --sensor WxH")
    return EventFile(
        path=path,
        format=f"ROS 1 bag ({bag.connections[topic.connection].kind})",
        sensor=sensor or size,
        start_us=int(first.t.min()),
        stop_us=int(last.t.max()) + 1,
        read=topic.read,
        camera=_camera(bag, topic.connection, sensor or size),
        read_gyroscope=lambda: bag_gyroscope(bag, topic.connection, topic.of_stamp),
        contents=_contents(bag),
    )


def _event_topic(bag: Bag) -> tuple[EventTopic, tuple[int, int]]:
    """The topic with the most event messages, and the sensor's size."""
    found = [name for name, connection in bag.connections.items() if connection.kind in ARRAYS + PACKETS]
    if not any(bag.count(name) for name in found):
        topics = ", ".join(sorted(connection.topic for connection in bag.connections.values())[:8])
        raise BadFile(
            f"{bag.path.name} holds no event messages, only {topics or 'nothing'}",
            fix=f"give a bag with one of: {', '.join(ARRAYS + PACKETS)}",
        )
    chosen = max(found, key=bag.count)
    if others := [bag.connections[name].topic for name in found if name != chosen]:
        read, left = bag.connections[chosen].topic, ", ".join(others)
        text = f"{bag.path.name} has {len(found)} topics with events: {read} is read, not {left}"
        warnings.warn(text, EvimoWarning, stacklevel=4)
    topic = EventTopic(bag, chosen)
    return topic, image_size(next(bag.messages(topic.chunks()[0], {chosen})).payload)


def _contents(bag: Bag) -> dict[str, str]:
    """What else is in the bag: name to topics with their numbers of messages."""
    contents: dict[str, list[str]] = {}
    for name, connection in bag.connections.items():
        kind = connection.kind.rpartition("/")[2]
        words = next((words for words, kinds in CONTENTS.items() if kind in kinds), "other")
        words = "event topics" if connection.kind in ARRAYS + PACKETS else words
        contents.setdefault(words, []).append(f"{connection.topic} ({bag.count(name):,})")
    return {words: ", ".join(topics) for words, topics in contents.items()}


def _camera(bag: Bag, events: int, size: tuple[int, int]) -> FoundCamera | None:
    """Intrinsics of a CameraInfo of the same size, best of the same namespace."""
    near = bag.connections[events].topic.rpartition("/")[0]
    names = [name for name, connection in bag.connections.items() if connection.kind == "sensor_msgs/CameraInfo"]
    for name in sorted(names, key=lambda name: bag.connections[name].topic.rpartition("/")[0] != near):
        for chunk in (chunk for chunk in bag.chunks if chunk.counts.get(name)):
            message = next(bag.messages(chunk, {name}))
            payload, source = message.payload, f"{bag.connections[name].topic} in the bag"
            found = found_camera(partial(_camera_info, payload), source)
            if found and found.camera.size == size:
                return found
            break
    return None


def _camera_info(payload: memoryview) -> Camera | None:
    from rosbags.typesys import Stores, get_typestore

    info: Any = get_typestore(Stores.ROS1_NOETIC).deserialize_ros1(payload, "sensor_msgs/msg/CameraInfo")
    fx, _, cx, _, fy, cy = (float(value) for value in info.K[:6])
    if fx == fy == 0:  # a driver's way to say that nobody calibrated
        return None
    return Camera(
        fx=fx,
        fy=fy,
        cx=cx,
        cy=cy,
        height=int(info.height),
        width=int(info.width),
        distortion=tuple(float(value) for value in info.D),
        lens="fisheye" if info.distortion_model in ("equidistant", "fisheye") else "radtan",
    )
