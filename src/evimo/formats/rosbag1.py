"""ROS 1 bags (version 2.0) chunk by chunk: the index gives chunks only, so that hours need little memory.

A bag without its index (the recorder died, the copy was cut) is walked from the front and used as far as it goes.
"""

import bz2
import struct
from collections.abc import Iterator, Set
from dataclasses import dataclass, field
from itertools import repeat
from pathlib import Path
from typing import IO

from evimo.errors import BadFile
from evimo.formats.bag_messages import Connection, Message

MESSAGE, BAG_HEADER, CHUNK, CHUNK_INFO, CONNECTION = 2, 3, 5, 6, 7
MOST_MESSAGES = 1 << 16  # of a chunk, whatever a damaged index says
UNPACK_U4 = struct.Struct("<I").unpack_from


@dataclass(frozen=True, slots=True)
class ChunkPlace:
    """Where a chunk lies, the times of its messages, and how many there are by connection."""

    offset: int
    start_ns: int
    stop_ns: int
    counts: dict[int, int]


@dataclass(slots=True)
class Rosbag1:
    """A ROS 1 bag.

    publishers: topic and kind of each connection.
    cut_short:  whether the chunks had to be found without the index.
    """

    path: Path
    publishers: dict[int, tuple[str, str]] = field(default_factory=dict[int, tuple[str, str]])
    chunks: list[ChunkPlace] = field(default_factory=list[ChunkPlace])
    cut_short: bool = False
    title: str = "ROS 1 bag"
    cdr: bool = False

    @property
    def stop_ns(self) -> int:
        """The time of the last message, by the recorder."""
        return max((chunk.stop_ns for chunk in self.chunks), default=0)

    @property
    def damage(self) -> str:
        """That the index is gone."""
        return f"has lost its index: its {len(self.chunks):,} readable chunks are used" if self.cut_short else ""

    @property
    def connections(self) -> dict[int, Connection]:
        """Publishers with their numbers of messages."""
        counts: dict[int, int] = {}
        for chunk in self.chunks:
            for name, count in chunk.counts.items():
                counts[name] = counts.get(name, 0) + count
        return {name: Connection(topic, kind, counts.get(name, 0)) for name, (topic, kind) in self.publishers.items()}

    def messages(self, wanted: Set[int], start_ns: int | None = None) -> Iterator[Message]:
        """The messages of the wanted connections from the first chunk on that does not end before start_ns."""
        chunks = [chunk for chunk in self.chunks if wanted & chunk.counts.keys()]
        sooner = [at for at, chunk in enumerate(chunks) if start_ns is not None and chunk.stop_ns < start_ns]
        for chunk in chunks[sooner[-1] + 1 if sooner else 0 :]:
            yield from self._of_chunk(chunk, wanted)

    def _of_chunk(self, chunk: ChunkPlace, wanted: Set[int]) -> Iterator[Message]:
        """The messages of a chunk; in place of each that the index counts and damage has taken, one without bytes."""
        missing = {name: count for name, count in chunk.counts.items() if name in wanted}
        for op, fields, payload in _records(self._body(chunk)):
            try:
                connection, time_ns = UNPACK_U4(fields[b"conn"])[0], _time(fields[b"time"])
            except (KeyError, struct.error):  # of another kind, or damaged
                continue
            if op == MESSAGE and connection in wanted:
                missing[connection] = missing.get(connection, 0) - 1
                yield Message(connection, time_ns, payload)
        for connection, count in missing.items():
            yield from repeat(Message(connection, chunk.stop_ns, memoryview(b"")), min(max(count, 0), MOST_MESSAGES))

    def _body(self, chunk: ChunkPlace) -> memoryview:
        """The records of a chunk; none where its own header is damaged."""
        with self.path.open("rb") as file:
            file.seek(chunk.offset)
            try:
                _, fields = _header(file)
                return _unpacked(file.read(_u4(file)), fields)
            except (struct.error, KeyError, EOFError):
                return memoryview(b"")


def open_bag(path: Path) -> Rosbag1:
    """Read the index, or where there is none walk the chunks.

    Raises:
        BadFile: encrypted, or nothing in it is readable.
    """
    with path.open("rb") as file:
        file.readline()
        try:
            _, fields = _header(file)
            index, chunks = struct.unpack("<QI", fields[b"index_pos"] + fields[b"chunk_count"])
            if fields.get(b"encryptor"):
                raise BadFile(f"{path.name} is an encrypted bag", fix="decrypt it first")
            if 0 < index < path.stat().st_size:
                return _indexed(path, file, index, chunks)
        except (struct.error, KeyError, EOFError):
            pass
    bag = _walked(path)
    if not bag.chunks:
        raise BadFile(f"{path.name} is a bag without a readable chunk", fix="copy or record it again: it was cut short")
    return bag


def _indexed(path: Path, file: IO[bytes], index: int, chunks: int) -> Rosbag1:
    """The bag by its index; EOFError where that is damaged, so that it does not tell of all chunks."""
    bag = Rosbag1(path)
    file.seek(index)
    for op, fields, data in _records(memoryview(file.read())):
        if op == CONNECTION:
            bag.publishers[UNPACK_U4(fields[b"conn"])[0]] = _connection(fields, data)
        elif op == CHUNK_INFO:
            counts = dict(struct.iter_unpack("<II", data))
            start, stop = _time(fields[b"start_time"]), _time(fields[b"end_time"])
            bag.chunks.append(ChunkPlace(struct.unpack("<Q", fields[b"chunk_pos"])[0], start, stop, counts))
    if not bag.publishers or len(bag.chunks) != chunks:
        raise EOFError
    return bag


def _walked(path: Path) -> Rosbag1:
    bag = Rosbag1(path, cut_short=True)
    with path.open("rb") as file:
        file.readline()
        try:
            while True:
                offset = file.tell()
                op, fields = _header(file)
                size = _u4(file)
                if op == CHUNK:
                    _add_chunk(bag, offset, _unpacked(file.read(size), fields))
                else:
                    file.seek(size, 1)
        except (struct.error, KeyError, EOFError):
            return bag


def _add_chunk(bag: Rosbag1, offset: int, body: memoryview) -> None:
    times: list[int] = []
    counts: dict[int, int] = {}
    for op, fields, data in _records(body):
        connection = UNPACK_U4(fields[b"conn"])[0]
        if op == CONNECTION:
            bag.publishers[connection] = _connection(fields, data)
        elif op == MESSAGE:
            times.append(_time(fields[b"time"]))
            counts[connection] = counts.get(connection, 0) + 1
    if times:
        bag.chunks.append(ChunkPlace(offset, min(times), max(times), counts))


def _connection(fields: dict[bytes, bytes], data: memoryview) -> tuple[str, str]:
    return fields[b"topic"].decode(), _fields(bytes(data))[b"type"].decode()


def _unpacked(data: bytes, fields: dict[bytes, bytes]) -> memoryview:
    """A chunk's records; of a chunk cut short those that are there, if it is not compressed."""
    compression = fields[b"compression"]
    try:
        if compression == b"bz2":
            return memoryview(bz2.decompress(data))
        if compression == b"lz4":
            import lz4.frame  # here: training on a borrowed GPU has no such library (bench/gpu_run.py)

            return memoryview(lz4.frame.decompress(data))
    except (ValueError, OSError, RuntimeError, EOFError):
        return memoryview(b"")
    return memoryview(data)


def _records(body: memoryview) -> Iterator[tuple[int, dict[bytes, bytes], memoryview]]:
    """Kind, fields and data of each whole record."""
    at = 0
    while at + 4 <= len(body):
        data_at = at + 4 + UNPACK_U4(body, at)[0]
        if data_at + 4 > len(body):
            return
        stop = data_at + 4 + UNPACK_U4(body, data_at)[0]
        if stop > len(body):
            return
        fields = _fields(bytes(body[at + 4 : data_at]))
        if not fields.get(b"op"):  # what follows a damaged record cannot be found
            return
        yield fields[b"op"][0], fields, body[data_at + 4 : stop]
        at = stop


def _header(file: IO[bytes]) -> tuple[int, dict[bytes, bytes]]:
    fields = _fields(file.read(_u4(file)))
    if not fields.get(b"op"):
        raise EOFError
    return fields[b"op"][0], fields


def _fields(raw: bytes) -> dict[bytes, bytes]:
    fields: dict[bytes, bytes] = {}
    at = 0
    while at + 4 <= len(raw):
        stop = at + 4 + UNPACK_U4(raw, at)[0]
        name, _, value = raw[at + 4 : stop].partition(b"=")
        fields[name] = value
        at = stop
    return fields


def _u4(file: IO[bytes]) -> int:
    raw = file.read(4)
    if len(raw) < 4:
        raise EOFError
    return UNPACK_U4(raw)[0]


def _time(raw: bytes) -> int:
    seconds, nanoseconds = struct.unpack("<II", raw)
    return seconds * 10**9 + nanoseconds
