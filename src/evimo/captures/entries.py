"""Settings in YAML as typed entries that know their file and line, so that every error can name its place."""

import difflib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias, TypeVar

import numpy as np
import yaml
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from evimo.errors import BadFile, NotFound

Word = TypeVar("Word", bound=str)
Value: TypeAlias = "str | list[Entry] | dict[str, Entry] | None"

LARGEST_FILE = 1_000_000  # bytes
MOST_ENTRIES = 10_000  # with what aliases repeat: a few lines of YAML can name a thousand million
POSE_FORM = "{position: [x, y, z], quaternion: [x, y, z, w]}, m, the quaternion of length 1"
GUIDE = "docs/captures.md has an example"


@dataclass(frozen=True)
class Entry:
    """One value of a file, and where it stands.

    name: the keys that lead to it, with dots between. value: a word, a list, or fields by name; None of an empty one.
    """

    file: Path
    line: int
    name: str
    value: Value

    @property
    def place(self) -> str:
        """The file and the line."""
        return f"{self.file}, line {self.line}"

    def wrong(self, problem: str, *, fix: str = GUIDE) -> BadFile:
        """The error that says what is wrong with this entry."""
        return BadFile(f"{self.place}: {f'`{self.name}` ' if self.name else ''}{problem}", fix=fix)

    def fields(self, required: Sequence[str], optional: Sequence[str] = ()) -> dict[str, "Entry"]:
        """The fields of a mapping that has these keys and no others.

        Raises:
            BadFile: it is no mapping, a key is missing, or there is another one.
        """
        known, found = [*required, *optional], self.named()
        for key, entry in found.items():
            if key not in known:
                close = difflib.get_close_matches(key, known, 1)
                raise entry.wrong("is no known key", fix=close[0] if close else f"one of: {', '.join(known)}")
        for key in required:
            if key not in found:
                raise self.wrong(f"lacks `{key}`")
        return found

    def named(self) -> dict[str, "Entry"]:
        """The fields of a mapping, whatever their keys.

        Raises:
            BadFile: it is no mapping.
        """
        if not isinstance(self.value, dict):
            raise self.wrong("should hold `key: value` lines")
        return self.value

    def entries(self) -> list["Entry"]:
        """The entries of a list; a single word is a list of one, and nothing is an empty one.

        Raises:
            BadFile: it is a mapping.
        """
        if isinstance(self.value, dict):
            raise self.wrong("should be a list")
        if self.value is None:
            return []
        return self.value if isinstance(self.value, list) else [self]

    def text(self) -> str:
        """A word.

        Raises:
            BadFile: it is none.
        """
        if not isinstance(self.value, str) or not self.value:
            raise self.wrong("should be a word")
        return self.value

    def one_of(self, words: Iterable[Word]) -> Word:
        """One of some words.

        Raises:
            BadFile: it is none of them.
        """
        text, known = self.text(), list(words)
        for word in known:
            if word == text:
                return word
        raise self.wrong(f"is {text!r}", fix=f"one of: {', '.join(known)}")

    def number(self) -> float:
        """A finite number.

        Raises:
            BadFile: it is none.
        """
        try:
            number = float(self.text())
        except ValueError:
            number = np.nan
        if not np.isfinite(number):
            raise self.wrong(f"should be a number, not {self.value!r}")
        return number

    def whole(self, low: int, high: int) -> int:
        """A whole number with low <= number <= high.

        Raises:
            BadFile: it is none.
        """
        number = self.number()
        if number != int(number) or not low <= number <= high:
            raise self.wrong(f"should be a whole number from {low} to {high}, not {self.text()}")
        return int(number)

    def numbers(self, count: int) -> NDArray[np.float64]:
        """A list of so many numbers.

        Raises:
            BadFile: it is none.
        """
        found = self.entries()
        if len(found) != count:
            raise self.wrong(f"should be a list of {count} numbers")
        return np.array([entry.number() for entry in found])

    def path(self) -> Path:
        """A file or folder that exists, from the folder of the file that names it on.

        Raises:
            BadFile: no word. NotFound: there is none.
        """
        path = self.file.parent / self.text()
        if not path.exists():
            raise NotFound(f"{self.place}: there is no '{path}'", fix=f"the path from {self.file.parent} on")
        return path

    def pose(self) -> NDArray[np.float64]:
        """A pose (4, 4) of a position in m and a quaternion x y z w.

        Raises:
            BadFile: it is none.
        """
        given = self.fields(("position", "quaternion"))
        quaternion = given["quaternion"].numbers(4)
        if abs(np.linalg.norm(quaternion) - 1) > 0.01:
            raise given["quaternion"].wrong(f"has length {np.linalg.norm(quaternion):.3g}", fix=POSE_FORM)
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_quat(quaternion).as_matrix()
        pose[:3, 3] = given["position"].numbers(3)
        return pose


def pose_words(a_from_b: NDArray[np.float64]) -> dict[str, list[float]]:
    """A pose (4, 4) as `Entry.pose` reads it, for files that tools write."""
    quaternion = Rotation.from_matrix(a_from_b[:3, :3]).as_quat()
    return {"position": a_from_b[:3, 3].tolist(), "quaternion": quaternion.tolist()}


def load_entries(path: Path) -> Entry:
    """The content of a YAML file; nothing in it is run.

    Raises:
        NotFound: there is no such file. BadFile: it is no YAML, too large, or has a key twice.
    """
    if not path.is_file():
        raise NotFound(f"there is no file '{path}'", fix="check the path")
    try:
        raw = path.read_bytes()
        if len(raw) > LARGEST_FILE:
            raise BadFile(f"{path}: {len(raw):,} bytes are too many for settings", fix=GUIDE)
        node = yaml.compose(raw.decode("utf-8-sig"), Loader=yaml.SafeLoader)
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        place = f", line {mark.line + 1}" if mark else ""
        why = str(getattr(error, "problem", None) or error).splitlines()[0][:200]
        raise BadFile(f"{path}{place}: not YAML ({why})", fix=GUIDE) from error
    if node is None:
        raise BadFile(f"{path} is empty", fix=GUIDE)
    return _entry(path, node, "", [0])


def _entry(path: Path, node: yaml.Node, name: str, count: list[int]) -> Entry:
    """A node and all below it; count: of entries so far."""
    count[0] += 1
    if count[0] > MOST_ENTRIES:
        raise BadFile(f"{path} has more than {MOST_ENTRIES:,} entries", fix=GUIDE)
    line = node.start_mark.line + 1
    if isinstance(node, yaml.SequenceNode):
        return Entry(path, line, name, [_entry(path, each, f"{name}[{k}]", count) for k, each in enumerate(node.value)])
    if not isinstance(node, yaml.MappingNode):
        word = None if node.tag.endswith(":null") else str(node.value)
        return Entry(path, line, name, word)
    fields: dict[str, Entry] = {}
    for key, value in node.value:
        word = str(key.value)
        entry = _entry(path, value, f"{name}.{word}" if name else word, count)
        entry = Entry(path, key.start_mark.line + 1, entry.name, entry.value)
        if word in fields:
            raise entry.wrong(f"stands here and in line {fields[word].line}", fix="one of them")
        fields[word] = entry
    return Entry(path, line, name, fields)


def merged(one: Entry, other: Entry) -> Entry:
    """Two mappings as one.

    Raises:
        BadFile: both say something of the same key.
    """
    if not isinstance(one.value, dict) or not isinstance(other.value, dict):
        raise other.wrong(f"stands here and in {one.place}", fix="one of them")
    fields = dict(one.value)
    for key, entry in other.value.items():
        fields[key] = merged(fields[key], entry) if key in fields else entry
    return Entry(one.file, one.line, one.name, fields)
