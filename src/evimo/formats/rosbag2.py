"""ROS 2 bags: a folder or one of its files (db3 or mcap), opened by the library rosbags and read in order of time.

Definitions of messages are not needed, nor metadata.yaml: a recorder that was killed writes none.
"""

import warnings
from collections.abc import Generator, Iterator, Set
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import yaml

from evimo.errors import BadFile, EvimoError, EvimoWarning
from evimo.formats.zstandard import zstd
from evimo.formats.bag_messages import Connection, Message
from evimo.formats.mcap_tail import CutMcap, is_cut

MAGICS = {b"SQLite format 3": ".db3", b"\x89MCAP0\r\n": ".mcap"}
METADATA = "metadata.yaml"
ZSTD = b"\x28\xb5\x2f\xfd"
LARGEST_METADATA = 10_000_000  # bytes; it lists topics and files


@dataclass(frozen=True, slots=True)
class StorageFile:
    """One file of a bag: where, by which plugin of the library it is read, and the times of its messages."""

    path: Path
    plugin: str
    start_ns: int
    stop_ns: int
    cut_short: bool


@dataclass(slots=True)
class Rosbag2:
    """A ROS 2 bag: connections by topic and kind over all its files, which are in order of time."""

    path: Path
    title: str = "ROS 2 bag"
    cdr: bool = True
    files: list[StorageFile] = field(default_factory=list[StorageFile])
    connections: dict[int, Connection] = field(default_factory=dict[int, Connection])
    missing: list[str] = field(default_factory=list[str])

    @property
    def stop_ns(self) -> int:
        """The time of the last message, by the recorder."""
        return max((file.stop_ns for file in self.files), default=0)

    @property
    def damage(self) -> str:
        """Which files are gone, or have lost their index."""
        cut = [file.path.name for file in self.files if file.cut_short]
        gone = f"lacks {', '.join(self.missing)}, which its metadata names" if self.missing else ""
        lost = f"has lost its index ({', '.join(cut)}): what is readable is used" if cut else ""
        return "; it ".join(filter(None, (gone, lost)))

    def messages(self, wanted: Set[int], start_ns: int | None = None) -> Iterator[Message]:
        """The messages of the wanted connections from start_ns on, or all."""
        numbers = {self.connections[number][:2]: number for number in wanted}
        for file in self.files:
            if start_ns is not None and file.stop_ns < start_ns:
                continue
            with _opened(file.path, file.plugin, cut=file.cut_short) as storage:
                theirs = [each for each in storage.connections if _named(each) in numbers]
                if theirs:
                    for connection, time_ns, data in storage.messages(theirs, start=start_ns):
                        yield Message(numbers[_named(connection)], time_ns, memoryview(_unpacked(data)))

    def add(self, path: Path, plugin: str) -> None:
        """Take in a file's topics and times."""
        cut = plugin == ".mcap" and is_cut(path)
        with _opened(path, plugin, cut=cut) as storage:
            span = storage.metadata
            self.files.append(StorageFile(path, plugin, span.start_time, span.end_time, cut))
            for each in storage.connections:
                if (form := each.ext.serialization_format) != "cdr":
                    raise BadFile(f"{path.name}: messages serialised as {form!r}", fix="record them as ROS 2 does, cdr")
                known = {connection[:2]: number for number, connection in self.connections.items()}
                number = known.get(_named(each), len(known))
                before = self.connections[number].count if number in self.connections else 0
                self.connections[number] = Connection(*_named(each), before + each.msgcount)


def open_bag(path: Path) -> Rosbag2:
    """Open a folder with all its files, or one file.

    Raises:
        BadFile: there is no file of a bag, or one is damaged.
    """
    path = path.parent if path.name == METADATA else path
    paths, missing = _files(path) if path.is_dir() else ([path], [])
    bag = Rosbag2(path, missing=missing)
    for each in paths:
        if (plugin := plugin_of(each)) is None:
            raise BadFile(f"{each} is no file of a ROS 2 bag (db3, mcap)", fix="copy it again")
        bag.add(each, plugin)
        _warn_of_journal(each)
    bag.files.sort(key=lambda file: file.start_ns)
    kinds = sorted({file.plugin[1:] for file in bag.files})
    bag.title = f"ROS 2 bag, {' and '.join(kinds)}"
    return bag


def is_folder_of_bag(path: Path) -> bool:
    """Whether a folder holds a bag, with its metadata or without."""
    return (path / METADATA).is_file() or any(plugin_of(each) for each in path.glob("*.*"))


def plugin_of(path: Path) -> str | None:
    """By which plugin of the library a file is read, from its first bytes; None where it is no file of a bag."""
    try:
        with path.open("rb") as file:
            start = file.read(16)
    except OSError:
        return None
    return next((plugin for magic, plugin in MAGICS.items() if start.startswith(magic)), None)


def _files(folder: Path) -> tuple[list[Path], list[str]]:
    """The files of a bag's folder, and the names of those that its metadata lists and that are not there."""
    there = sorted(path for path in folder.glob("*.*") if plugin_of(path))
    listed = _listed(folder / METADATA)
    # A file that was compressed as a whole is named with its suffix; once it is unpacked, it lies there without.
    plain = {name.removesuffix(".zstd") for name in listed}
    packed = [path.name for path in folder.glob("*.zstd") if path.with_suffix("") not in there]
    if packed:
        raise BadFile(
            f"{folder} is compressed file by file ({', '.join(packed[:3])})", fix=f"unpack it first: unzstd {folder}/*.zstd"
        )
    files = [path for path in there if path.name in plain] or there
    if not files:
        raise BadFile(f"the folder {folder} holds no file of its bag (db3, mcap)", fix="copy the whole folder again")
    return files, sorted(plain - {path.name for path in files})


def _listed(metadata: Path) -> list[str]:
    """The names of the files that the metadata lists; none where it is not there or not readable, as nobody needs it."""
    try:
        if metadata.stat().st_size > LARGEST_METADATA:
            return []
        tree: Any = yaml.safe_load(metadata.read_bytes())
        paths = cast("list[str]", tree["rosbag2_bagfile_information"]["relative_file_paths"])
        return [Path(path).name for path in paths]
    except (OSError, ValueError, KeyError, TypeError, yaml.YAMLError, RecursionError):
        return []


def _warn_of_journal(path: Path) -> None:
    journal = path.with_name(f"{path.name}-wal")
    if journal.is_file() and journal.stat().st_size:
        text = f"{journal.name} holds messages that are not read: `sqlite3 {path.name} .tables` moves them into the bag"
        warnings.warn(text, EvimoWarning, stacklevel=5)


@contextmanager
def _opened(path: Path, plugin: str, *, cut: bool) -> Generator[Any]:
    """The library's reader of one file. It is a stranger's file: whatever the library stumbles over is said as damage."""
    from rosbags.rosbag2 import Reader

    kinds = cast("dict[str, Any]", Reader.STORAGE_PLUGINS)
    storage = kinds[plugin](CutMcap(path) if cut else path)
    is_open = False
    try:
        storage.open()
        is_open = True
        yield storage
    except (EvimoError, GeneratorExit):
        raise
    except Exception as error:
        why = str(error).splitlines()[0] if str(error) else type(error).__name__
        fix = "copy it again, or `sqlite3 FILE .recover`" if plugin == ".db3" else "copy it again, or `mcap recover FILE`"
        raise BadFile(f"{path.name} is a damaged ROS 2 bag, {plugin[1:]} ({why[:200]})", fix=fix) from error
    finally:
        if is_open:
            storage.close()


def _named(connection: Any) -> tuple[str, str]:
    """Topic and `package/Type` of a connection of the library."""
    return connection.topic, str(connection.msgtype).replace("/msg/", "/")


def _unpacked(data: bytes) -> bytes:
    """A message that the recorder compressed by itself is known by its start: CDR begins with a zero."""
    return zstd().decompress(data) if data.startswith(ZSTD) else data
