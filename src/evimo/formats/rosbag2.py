"""ROS 2 bags: a folder or one of its files (db3 or mcap), read in order of time.

Definitions of messages are not needed, nor metadata.yaml: a recorder that was killed writes none.
"""

from collections.abc import Callable, Iterator, Set
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import yaml

from evimo.errors import BadFile
from evimo.formats.bag_messages import Connection, Message
from evimo.formats.rosbag2_db3 import Db3File, open_db3
from evimo.formats.rosbag2_mcap import McapFile, open_mcap
from evimo.formats.zstandard import zstd

OPENERS: dict[bytes, tuple[str, Callable[[Path], Db3File | McapFile]]] = {
    b"SQLite format 3": ("db3", open_db3),
    b"\x89MCAP0\r\n": ("mcap", open_mcap),
}
METADATA = "metadata.yaml"
ZSTD = b"\x28\xb5\x2f\xfd"
LARGEST_METADATA = 10_000_000  # bytes; it lists topics and files


@dataclass(slots=True)
class Rosbag2:
    """A ROS 2 bag: its files in order of time, and connections by topic and kind over all of them.

    missing: names of files that its metadata lists and that are not there.
    """

    path: Path
    title: str
    files: list[Db3File | McapFile]
    missing: list[str] = field(default_factory=list[str])
    cdr: bool = True

    @property
    def stop_ns(self) -> int:
        """The time of the last message, by the recorder."""
        return max((file.stop_ns for file in self.files), default=0)

    @property
    def damage(self) -> str:
        """Which files are gone, or have lost their index."""
        cut = ", ".join(file.path.name for file in self.files if file.cut_short)
        gone = f"lacks {', '.join(self.missing)}, which its metadata names" if self.missing else ""
        lost = f"has lost its index ({cut}): what is readable is used" if cut else ""
        return "; it ".join(filter(None, (gone, lost)))

    @property
    def connections(self) -> dict[int, Connection]:
        """Numbered over all files."""
        counts: dict[tuple[str, str], int] = {}
        for file in self.files:
            for topic, kind, messages in file.connections.values():
                counts[topic, kind] = counts.get((topic, kind), 0) + messages
        return {number: Connection(*key, messages) for number, (key, messages) in enumerate(counts.items())}

    def messages(self, wanted: Set[int], start_ns: int | None = None) -> Iterator[Message]:
        """The messages of the wanted connections from start_ns on, or all."""
        ours = {self.connections[number][:2]: number for number in wanted}
        for file in self.files:
            theirs = {number: ours[each[:2]] for number, each in file.connections.items() if each[:2] in ours}
            if theirs and (start_ns is None or file.stop_ns >= start_ns):
                for number, time_ns, payload in file.messages(theirs.keys(), start_ns):
                    yield Message(theirs[number], time_ns, _unpacked(payload))


def open_bag(path: Path) -> Rosbag2:
    """Open a folder with all its files, or one file.

    Raises:
        BadFile: there is no file of a bag, or one is damaged.
    """
    path = path.parent if path.name == METADATA else path
    paths, missing = _files(path) if path.is_dir() else ([path], [])
    files: list[Db3File | McapFile] = []
    kinds: set[str] = set()
    for each in paths:
        if (opener := _opener(each)) is None:
            raise BadFile(f"{each} is no file of a ROS 2 bag (db3, mcap)", fix="copy it again")
        kinds.add(opener[0])
        files.append(opener[1](each))
    files.sort(key=lambda file: file.start_ns)
    return Rosbag2(path, f"ROS 2 bag, {' and '.join(sorted(kinds))}", files, missing)


def is_folder_of_bag(path: Path) -> bool:
    """Whether a folder holds a bag, with its metadata or without."""
    return (path / METADATA).is_file() or any(_opener(each) for each in path.glob("*.*"))


def _opener(path: Path) -> tuple[str, Callable[[Path], Db3File | McapFile]] | None:
    """What a file of a bag is and how it is opened, from its first bytes; None where it is none."""
    if not path.is_file():  # a pipe would be waited for
        return None
    try:
        with path.open("rb") as file:
            start = file.read(16)
    except OSError:
        return None
    return next((opener for magic, opener in OPENERS.items() if start.startswith(magic)), None)


def _files(folder: Path) -> tuple[list[Path], list[str]]:
    """The files of a bag's folder, and the names of those that its metadata lists and that are not there."""
    there = sorted(path for path in folder.glob("*.*") if _opener(path))
    listed = _listed(folder / METADATA)
    # A file that was compressed as a whole is named with its suffix; once it is unpacked, it lies there without.
    plain = {name.removesuffix(".zstd") for name in listed}
    packed = [path.name for path in folder.glob("*.zstd") if path.with_suffix("") not in there]
    if packed:
        raise BadFile(
            f"{folder} is compressed file by file ({', '.join(packed[:3])})",
            fix=f"unpack it first: unzstd {folder}/*.zstd",
        )
    files = [path for path in there if path.name in plain] or there
    if not files:
        raise BadFile(f"the folder {folder} holds no file of its bag (db3, mcap)", fix="copy the whole folder again")
    found = {path.name for path in files}
    return files, sorted(plain - found) if plain & found else []  # none of them: the file was given another name


def _listed(metadata: Path) -> list[str]:
    """The names of the files that the metadata lists; none where it is not there or not readable: nobody needs it."""
    try:
        if metadata.stat().st_size > LARGEST_METADATA:
            return []
        tree: Any = yaml.safe_load(metadata.read_bytes())
        paths = cast("list[str]", tree["rosbag2_bagfile_information"]["relative_file_paths"])
        return [Path(path).name for path in paths]
    except (OSError, ValueError, KeyError, TypeError, yaml.YAMLError, RecursionError):
        return []


def _unpacked(payload: memoryview) -> memoryview:
    """A message that the recorder compressed by itself is known by its start: CDR begins with a zero."""
    if bytes(payload[:4]) != ZSTD:
        return payload
    try:
        return memoryview(zstd().decompress(bytes(payload)))
    except Exception:  # the library's own kind has two homes
        return payload  # which its decoder will find to be damaged
