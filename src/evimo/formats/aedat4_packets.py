"""The parts of an AEDAT 4 file: head, packets, and the table of packets at its end.

A line; a FlatBuffer head (compression, place of the table, XML of the streams); packets of (stream i4, size i4, a
compressed FlatBuffer whose first field is a vector); the table, compressed likewise. FlatBuffers but the head begin
with their own size.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, NamedTuple
from xml.etree import ElementTree

import lz4.frame
import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile
from evimo.formats.zstandard import zstd

EVENT_BYTES = 16
FIRST_LINE_BYTES = 14
LIKELY_BYTES = 1 << 20  # of a packet: as large a piece of memory need not grow while it is filled
GYROSCOPE_FIELDS = (5, 6, 7)  # of a sample: after its time, temperature and three accelerations


class Stream(NamedTuple):
    """One stream of a file: four letters for its type, (height, width) where it has one, the camera's name, its own."""

    kind: str
    size: tuple[int, int]
    camera: str
    output: str = ""


class Head(NamedTuple):
    """What the head tells."""

    compression: int
    table_at: int
    streams: dict[int, Stream]
    first_packet: int


@dataclass(frozen=True, slots=True)
class PacketTable:
    """The table of packets as columns: byte offset, stream, elements, first and last time in µs."""

    offset: NDArray[np.int64]
    stream: NDArray[np.int64]
    count: NDArray[np.int64]
    start_us: NDArray[np.int64]
    stop_us: NDArray[np.int64]

    def of(self, stream: int) -> "PacketTable":
        """The rows of one stream that hold anything."""
        rows = (self.stream == stream) & (self.count > 0)
        return PacketTable(
            self.offset[rows], self.stream[rows], self.count[rows], self.start_us[rows], self.stop_us[rows]
        )


def head(path: Path) -> Head:
    """Read the head.

    Raises:
        BadFile: it is cut short or damaged.
    """
    with path.open("rb") as file:
        file.seek(FIRST_LINE_BYTES)
        size = int.from_bytes(file.read(4), "little")
        raw = file.read(size)
    try:
        if len(raw) < size:
            raise ValueError
        compression = _value(raw, 0, 0, "<i")
        xml = _field(raw, 0, 2)
        text = xml + struct.unpack_from("<I", raw, xml)[0]
        length = struct.unpack_from("<I", raw, text)[0]
        streams = _streams(raw[text + 4 : text + 4 + length].decode())
        return Head(compression, _value(raw, 0, 1, "<q"), streams, FIRST_LINE_BYTES + 4 + size)
    except (struct.error, ElementTree.ParseError, ValueError, KeyError) as error:
        raise BadFile(f"{path.name}: its head is cut short or damaged", fix="copy or record it again") from error


def packet_table(path: Path, head: Head) -> PacketTable | None:
    """The table at the end; None where the file was cut short or never finished."""
    if not 0 < head.table_at < path.stat().st_size:
        return None
    with path.open("rb") as file:
        file.seek(head.table_at)
        raw = file.read()
    try:
        return _table(np.frombuffer(unpacked(raw, head.compression), np.uint8))
    except (struct.error, IndexError, ValueError):
        return None


def walked(path: Path, first: int, last: int) -> Iterator[tuple[int, int]]:
    """Byte offset and stream of each whole packet from byte `first` to byte `last`, from the sizes before them."""
    with path.open("rb") as file:
        at = first
        while at + 8 <= last:
            file.seek(at)
            stream, size = struct.unpack("<ii", file.read(8))
            if size < 0 or at + 8 + size > last:
                return
            yield at, stream
            at += 8 + size


def packet_records(file: IO[bytes], offset: int, compression: int) -> NDArray[np.uint64]:
    """The events (N, 2) u8 of the packet at a byte offset, as they are stored.

    Raises:
        ValueError: the packet is damaged.
    """
    try:
        raw = _packet(file, offset, compression)
        vector, count = _vector(raw)
        stored = np.frombuffer(raw, np.uint8, count * EVENT_BYTES, vector)
    except struct.error as error:
        raise ValueError("not a packet of events") from error
    return np.require(stored.view("<u8"), requirements="A").reshape(-1, 2)


def packet_rates(file: IO[bytes], offset: int, compression: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Times (N,) µs and angular velocities (N, 3) degrees/s of the IMU samples of the packet at a byte offset.

    Raises:
        ValueError: the packet is damaged.
    """
    try:
        rows = _rows(np.frombuffer(_packet(file, offset, compression), np.uint8))
        rates = [rows.column(number, "<f4") for number in GYROSCOPE_FIELDS]
        return rows.column(0, "<i8").astype(np.int64), np.stack(rates, axis=1).astype(np.float64)
    except (struct.error, IndexError) as error:
        raise ValueError("not a packet of IMU samples") from error


def _packet(file: IO[bytes], offset: int, compression: int) -> bytes:
    file.seek(offset)
    size = struct.unpack("<ii", file.read(8))[1]
    return unpacked(file.read(max(size, 0)), compression)


def unpacked(raw: bytes, compression: int) -> bytes:
    """Bytes after decompression: 0 none, 1 and 2 LZ4, 3 and 4 zstd.

    Raises:
        ValueError: damaged, or of another compression.
    """
    try:
        if compression in (1, 2):
            context = lz4.frame.create_decompression_context()
            packet, _, whole = lz4.frame.decompress_chunk(context, raw, max_length=LIKELY_BYTES)
            return packet if whole else lz4.frame.decompress(raw)
        if compression in (3, 4):
            return zstd().decompress(raw)
    except Exception as error:  # each library has its own
        raise ValueError("damaged") from error
    if compression:
        raise ValueError(f"unknown compression {compression}")
    return raw


def _streams(xml: str) -> dict[int, Stream]:
    streams: dict[int, Stream] = {}
    for node in ElementTree.fromstring(xml).findall("node[@name='outInfo']/node"):
        kind = node.findtext("attr[@key='typeIdentifier']") or ""
        width, height = (int(node.findtext(f"node/attr[@key='size{axis}']") or 0) for axis in "XY")
        camera, output = node.findtext("node/attr[@key='source']"), node.findtext("attr[@key='originalOutputName']")
        streams[int(node.attrib["name"])] = Stream(kind, (height, width), camera or "", output or "")
    return streams


def _field(raw: bytes, root_at: int, number: int) -> int:
    """Where a field of a FlatBuffer's root table lies; 0 if it is left out."""
    root = root_at + struct.unpack_from("<I", raw, root_at)[0]
    table = root - struct.unpack_from("<i", raw, root)[0]
    if 4 + 2 * number >= struct.unpack_from("<H", raw, table)[0]:
        return 0
    offset = struct.unpack_from("<H", raw, table + 4 + 2 * number)[0]
    return root + offset if offset else 0


def _value(raw: bytes, root_at: int, number: int, kind: str) -> int:
    """A number in a field of a FlatBuffer's root table; 0 if it is left out."""
    at = _field(raw, root_at, number)
    return struct.unpack_from(kind, raw, at)[0] if at else 0


def _vector(raw: bytes) -> tuple[int, int]:
    """Where the vector in the first field of a packet begins, and its length."""
    field = _field(raw, 4, 0)
    if not field:
        return 0, 0
    at = field + struct.unpack_from("<I", raw, field)[0]
    return at + 4, struct.unpack_from("<I", raw, at)[0]


@dataclass(frozen=True, slots=True)
class _Rows:
    """A vector of FlatBuffer tables, read column by column: where each row, its layout and its fields are."""

    raw: NDArray[np.uint8]
    row: NDArray[np.int64]
    layout: NDArray[np.int64]
    fields: NDArray[np.int64]

    def column(self, number: int, kind: str) -> NDArray[Any]:
        """Numbers of one field; 0 where it is left out."""
        there = np.flatnonzero(self.fields > number)
        offset = _gathered(self.raw, self.layout[there] + 4 + 2 * number, "<u2").astype(np.int64)
        there, offset = there[offset > 0], offset[offset > 0]
        values = np.zeros(len(self.row), kind)
        values[there] = _gathered(self.raw, self.row[there] + offset, kind)
        return values


def _rows(raw: NDArray[np.uint8]) -> _Rows:
    first, count = _vector(raw.tobytes())
    if first + 4 * count > len(raw):  # before an array is made of as many
        raise ValueError(f"{count:,} rows in {len(raw):,} bytes")
    place = first + 4 * np.arange(count)
    row = place + _gathered(raw, place, "<u4")
    layout = row - _gathered(raw, row, "<i4")
    return _Rows(raw, row, layout, (_gathered(raw, layout, "<u2").astype(np.int64) - 4) // 2)


def _table(raw: NDArray[np.uint8]) -> PacketTable:
    rows = _rows(raw)
    columns = [rows.column(at, kind).astype(np.int64) for at, kind in enumerate(("<i8", "<i4", "<i8", "<i8", "<i8"))]
    return PacketTable(columns[0] - 8, *columns[1:])


def _gathered(raw: NDArray[np.uint8], at: NDArray[Any], kind: str) -> NDArray[Any]:
    """Numbers at unaligned places."""
    size = np.dtype(kind).itemsize
    return raw[at[:, None] + np.arange(size)].view(kind)[:, 0]
