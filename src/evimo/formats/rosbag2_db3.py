"""Files of ROS 2 bags in db3: SQLite with a table of topics and one of messages, whatever other tables a version has.

The library rosbags reads them too, but for those whose definitions of messages are missing or were lost.
"""

import sqlite3
import warnings
from collections.abc import Iterator, Set
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

from evimo.errors import BadFile, EvimoWarning
from evimo.formats.bag_messages import Connection, Message

TABLES = {"topics", "messages"}
# SQLite lets any value stand in any column; damage puts some there.
WHOLE = "typeof(topic_id) = 'integer' AND typeof(timestamp) = 'integer' AND typeof(data) = 'blob'"


@dataclass(slots=True)
class Db3File:
    """One file: its connections, and the times of its messages. It is opened for each pass.

    cut_short: its pages are not all there; messages are read in the order in which they were written, up to the damage.
    """

    path: Path
    connections: dict[int, Connection] = field(default_factory=dict[int, Connection])
    start_ns: int = 0
    stop_ns: int = 0
    cut_short: bool = False

    def messages(self, wanted: Set[int], start_ns: int | None = None) -> Iterator[Message]:
        """Messages of the wanted connections by time, from start_ns on, or all."""
        chosen = ",".join(str(number) for number in wanted)
        which = f"topic_id IN ({chosen}) AND {WHOLE}" + ("" if start_ns is None else f" AND timestamp >= {start_ns}")
        order = "id" if self.cut_short else "timestamp, id"
        select = f"SELECT topic_id, timestamp, data FROM messages WHERE {which} ORDER BY {order}"
        with closing(_connected(self.path)) as database:
            try:
                for number, time_ns, data in database.execute(select):
                    yield Message(number, time_ns, memoryview(data))
            except sqlite3.Error as error:
                if not self.cut_short:
                    raise _damaged(self.path, error) from error


def open_db3(path: Path) -> Db3File:
    """Read which topics and how many messages there are.

    Raises:
        BadFile: it is no bag, or nothing in it is readable.
    """
    file = Db3File(path)
    with closing(_connected(path)) as database:
        try:
            tables = {name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
            if not tables >= TABLES:
                raise BadFile(f"{path.name} is a database without a bag's tables", fix="give a bag of ROS 2")
            topics = list(database.execute("SELECT id, name, type, serialization_format FROM topics"))
        except sqlite3.Error as error:
            raise _damaged(path, error) from error
        try:
            counts = dict(database.execute(f"SELECT topic_id, count(*) FROM messages WHERE {WHOLE} GROUP BY topic_id"))
            span = database.execute(f"SELECT min(timestamp), max(timestamp) FROM messages WHERE {WHOLE}").fetchone()
        except sqlite3.Error:
            file.cut_short = True
            counts, span = _walked(database)
    file.start_ns, file.stop_ns = span[0] or 0, span[1] or 0
    for number, name, kind, form in topics:
        if form != "cdr":
            raise BadFile(f"{path.name}: messages serialised as {form!r}", fix="record them as ROS 2 does, as cdr")
        file.connections[number] = Connection(str(name), str(kind).replace("/msg/", "/"), counts.get(number, 0))
    return file


def _walked(database: sqlite3.Connection) -> tuple[dict[int, int], tuple[int, int]]:
    """Messages by topic and their first and last time, as far as the file is there."""
    counts: dict[int, int] = {}
    times: list[int] = []
    try:
        select = f"SELECT topic_id, timestamp, data FROM messages WHERE {WHOLE} ORDER BY id"
        for number, time_ns, _ in database.execute(select):
            counts[number] = counts.get(number, 0) + 1
            times = [min([time_ns, *times]), max([time_ns, *times])]
    except sqlite3.Error:
        pass
    return counts, (times[0], times[1]) if times else (0, 0)


def _connected(path: Path) -> sqlite3.Connection:
    """Read only, without leaving files beside it: `immutable`. A journal of a recorder that was killed is read too.

    With a schema that may be written, SQLite opens files that are shorter than they say; nothing is written.
    """
    uri = f"{path.absolute().as_uri()}?mode=ro"
    journal = path.with_name(f"{path.name}-wal")
    if journal.is_file() and journal.stat().st_size:
        try:
            database = sqlite3.connect(uri, uri=True)
            database.execute("SELECT 1 FROM sqlite_master").fetchone()
        except sqlite3.Error:
            text = f"{journal.name}, with the newest messages, cannot be read: copy both files where you may write"
            warnings.warn(text, EvimoWarning, stacklevel=4)
        else:
            return database
    database = sqlite3.connect(f"{uri}&immutable=1", uri=True)
    database.execute("PRAGMA writable_schema = ON")
    return database


def _damaged(path: Path, error: Exception) -> BadFile:
    return BadFile(
        f"{path.name} is a damaged ROS 2 bag, db3 ({error})",
        fix="copy it again, or `sqlite3 FILE .recover`",
    )
