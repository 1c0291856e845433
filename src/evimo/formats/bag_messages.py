"""What bags of ROS 1 and ROS 2 have in common: connections, and messages in the order in which they were recorded."""

import struct
from collections.abc import Callable, Container, Iterator, Set
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, Protocol

SECOND_NS = 10**9


class Connection(NamedTuple):
    """One kind of message on one topic: the topic, `package/Type`, and how many messages there are."""

    topic: str
    kind: str
    messages: int


class Message(NamedTuple):
    """One message as recorded."""

    connection: int
    time_ns: int
    payload: memoryview


class Bag(Protocol):
    """A bag that is open.

    cdr:   whether its messages are serialised as ROS 2 does it; else they are as ROS 1 does it.
    title: what to call it.
    """

    path: Path
    cdr: bool
    title: str

    @property
    def stop_ns(self) -> int:
        """The time of the last message, by the recorder."""
        ...

    @property
    def damage(self) -> str:
        """What of it is lost, in words; empty where nothing is known to be."""
        ...

    @property
    def connections(self) -> dict[int, Connection]:
        """By number; one topic may have several, as when its publisher was started again."""
        ...

    def messages(self, wanted: Set[int], start_ns: int | None = None) -> Iterator[Message]:
        """The messages of the wanted connections from a place on before which all were recorded before start_ns."""
        ...


class Topic(NamedTuple):
    """All messages of one kind on one topic: its connections, and how many messages they have."""

    name: str
    kind: str
    connections: frozenset[int]
    messages: int

    @property
    def namespace(self) -> str:
        """The name without its last word, which drivers share between the topics of one camera."""
        return self.name.rpartition("/")[0]


def topics(bag: Bag, kinds: Container[str] | None = None) -> list[Topic]:
    """The topics of a bag that hold messages, of the kinds or of all, by name."""
    found: dict[tuple[str, str], list[int]] = {}
    connections = bag.connections
    for number, (name, kind, messages) in connections.items():
        if messages and (kinds is None or kind in kinds):
            found.setdefault((name, kind), []).append(number)
    return [
        Topic(name, kind, frozenset(numbers), sum(connections[number].messages for number in numbers))
        for (name, kind), numbers in sorted(found.items())
    ]


class MessageFields:
    """The fields of one serialised message, read in order.

    ROS 1 packs them; ROS 2 (`cdr`) puts a number of n bytes at a multiple of n, counted from after the first four
    bytes. What is not all there raises struct.error or ValueError.
    """

    def __init__(self, payload: memoryview, *, cdr: bool) -> None:
        self._payload, self._cdr = payload, cdr
        self._at = 4 if cdr else 0
        if cdr and payload[1] != 1:
            raise ValueError("its bytes are not in the order of ROS 2 on a PC (CDR, little end first)")

    def numbers(self, form: str) -> tuple[Any, ...]:
        """Numbers of one type, as in "3d"."""
        unpack, size, step = _layout(form)
        at = self._at - (self._at - 4) % -step if self._cdr else self._at
        self._at = at + size
        return unpack(self._payload, at)

    def stamp_ns(self) -> int:
        """The time in the header that begins a message; its other fields are skipped."""
        if not self._cdr:
            self.numbers("I")  # a counter
        seconds, nanoseconds = self.numbers("2I")
        self.block()
        return seconds * SECOND_NS + nanoseconds

    def text(self) -> str:
        """A word."""
        return bytes(self.block()).rstrip(b"\0").decode(errors="replace")

    def block(self) -> memoryview:
        """A list of bytes, not copied."""
        (size,) = self.numbers("I")
        start, self._at = self._at, self._at + size
        if self._at > len(self._payload):
            raise ValueError(f"it ends before its {size} bytes do")
        return self._payload[start : self._at]

    def rest(self) -> memoryview:
        """All that follows, not copied."""
        return self._payload[self._at :]


@cache
def _layout(form: str) -> tuple[Callable[..., tuple[Any, ...]], int, int]:
    """What unpacks numbers of one type, the size of all of them in bytes, and of one."""
    layout = struct.Struct("<" + form)
    return layout.unpack_from, layout.size, struct.calcsize("<" + form[-1])
