"""Files of ROS 2 bags in mcap, through the library rosbags: chunks plain, lz4 or zstd, with or without an index."""

from collections.abc import Generator, Iterator, Set
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from evimo.errors import BadFile
from evimo.formats.bag_messages import Connection, Message
from evimo.formats.rosbag2_mcap_tail import CutMcap, is_cut


@dataclass(slots=True)
class McapFile:
    """One file: its connections, and the times of its messages. It is opened for each pass.

    cut_short: its end with the index is missing; it is read up to its last whole record.
    """

    path: Path
    connections: dict[int, Connection] = field(default_factory=dict[int, Connection])
    start_ns: int = 0
    stop_ns: int = 0
    cut_short: bool = False

    def messages(self, wanted: Set[int], start_ns: int | None = None) -> Iterator[Message]:
        """Messages of the wanted connections by time, from start_ns on, or all."""
        with _opened(self.path, cut=self.cut_short) as storage:
            theirs = [each for each in storage.connections if each.id in wanted]
            for connection, time_ns, data in storage.messages(theirs, start=start_ns):
                yield Message(connection.id, time_ns, memoryview(data))


def open_mcap(path: Path) -> McapFile:
    """Read which topics and how many messages there are.

    Raises:
        BadFile: it is no bag of ROS 2, or damaged.
    """
    file = McapFile(path, cut_short=is_cut(path))
    with _opened(path, cut=file.cut_short) as storage:
        file.start_ns, file.stop_ns = storage.metadata.start_time, storage.metadata.end_time
        for each in storage.connections:
            if (form := each.ext.serialization_format) != "cdr":
                raise BadFile(f"{path.name}: messages serialised as {form!r}", fix="record them as ROS 2 does, as cdr")
            file.connections[each.id] = Connection(each.topic, each.msgtype.replace("/msg/", "/"), each.msgcount)
    return file


@contextmanager
def _opened(path: Path, *, cut: bool) -> Generator[Any]:
    """The library's reader of one file. Whatever it stumbles over in a stranger's file is said as damage."""
    from rosbags.rosbag2 import Reader

    storage = cast("dict[str, Any]", Reader.STORAGE_PLUGINS)[".mcap"](CutMcap(path) if cut else path)
    is_open = False
    try:
        storage.open()
        is_open = True
        yield storage
    except BadFile:
        raise
    except Exception as error:
        why = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise BadFile(
            f"{path.name} is a damaged ROS 2 bag, mcap ({why[:200]})", fix="copy it again, or `mcap recover FILE`"
        ) from error
    finally:
        if is_open:
            storage.close()
