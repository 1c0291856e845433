"""The lines of a text file, whatever it is wrapped in: gzip, zstd, UTF-16, a byte order mark, any line ends.

Brackets and bars around numbers are read as spaces, and commas inside numbers as decimal points.
"""

import gzip
import re
import warnings
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evimo.errors import BadFile, EvimoWarning
from evimo.formats.zstandard import zstd

BLOCK_BYTES = 1 << 20
LONGEST_LINE = 1 << 16
GZIP = b"\x1f\x8b"
ZSTD = re.compile(rb"\x28\xb5\x2f\xfd|[\x50-\x5f]\x2a\x4d\x18")  # a frame, or one to be skipped, as pzstd begins with
BRACKETS = b"[](){}|"
BETWEEN = re.compile(rb"[;\t ]+")
COMMA = re.compile(rb"[-+]?\d+,(\d+)")
QUOTED_COMMAS = re.compile(rb"\"[-+]?\d+(,\d+)+\"|'[-+]?\d+(,\d+)+'")  # as spreadsheets have them


@dataclass(frozen=True, slots=True)
class TextSource:
    """A text file as blocks of whole lines in ASCII or UTF-8, each line ended by a newline.

    packed:   what the file is compressed with, if it is.
    encoding: "utf-16-le" or "utf-16-be" where it is in that.
    letters:  what each byte is read as, 256 of them; empty where each is itself.
    """

    path: Path
    packed: str = ""
    encoding: str = ""
    letters: bytes = b""

    @property
    def can_jump(self) -> bool:
        """Whether reading in the middle costs no more than at the beginning."""
        return not (self.packed or self.encoding)

    def blocks(self, place: int = 0) -> Iterator[tuple[int, bytes]]:
        """Blocks of whole lines from a place on, which is that of an earlier block: (place, lines).

        Raises:
            BadFile: a line is far too long for one.
        """
        rest = b""
        for more in self._pieces(place):
            raw = rest + more
            cut = raw.rfind(b"\n") + 1
            raw, rest = raw[:cut], raw[cut:]
            if len(rest) > LONGEST_LINE:
                raise BadFile(f"{self.path.name} is no event recording: it has no lines", fix="check what it holds")
            if raw:
                yield place, raw
                place += len(raw)
        if rest:
            yield place, rest + b"\n"

    def lines_near(self, share: float, size: int) -> bytes:
        """Some whole lines at a share of the file; nothing where it cannot be read in the middle."""
        with self.path.open("rb") as file:
            file.seek(int(share * self.path.stat().st_size))
            raw = self._plain(file.read(size))
        return raw[raw.find(b"\n") + 1 : raw.rfind(b"\n") + 1]

    def _pieces(self, place: int) -> Iterator[bytes]:
        """Bytes from a place on, as they come; the place counts what they have become, not the file's own."""
        with _opened(self.path, self.packed) as file:
            if self.can_jump:
                file.seek(place)
                place = 0
            carry = b""
            while raw := _read(file, self.path, BLOCK_BYTES):
                whole = carry + raw
                carry = whole[len(whole) // 2 * 2 :] if self.encoding else b""
                piece = self._plain(whole[: len(whole) - len(carry)])
                before = min(place, len(piece))
                place -= before
                yield piece[before:]

    def _plain(self, raw: bytes) -> bytes:
        if self.encoding:
            raw = raw.decode(self.encoding, errors="replace").replace("\ufeff", " ").encode("ascii", errors="replace")
        return raw.translate(self.letters) if self.letters else raw


def text_source(path: Path) -> TextSource:
    """Recognise what the lines of a file are wrapped in, from its first bytes.

    Raises:
        BadFile: commas in its numbers may stand for thousands or for decimal points.
    """
    packed = packing(path)
    start = unpacked_start(path)
    encoding = encoding_of(start)
    source = TextSource(path, packed, encoding)
    plain = source._plain(start[: len(start) // 2 * 2])  # pyright: ignore[reportPrivateUsage]
    return TextSource(path, packed, encoding, _letters(path, plain))


def _letters(path: Path, start: bytes) -> bytes:
    """What each byte of a file is read as, by its first lines."""
    table = bytearray(range(256))
    if b"\r" in start and b"\n" not in start:  # as old Macs end lines
        table[ord("\r")] = ord("\n")
    whole = start.translate(bytes(table)).rpartition(b"\n")[0] or start
    lines = [line.strip() for line in whole.split(b"\n")]
    rows = [line for line in lines if line[:1] not in (b"#", b"%") and len(re.findall(rb"\d+", line)) >= 4]
    if sum(line[:1] in (b"[", b"(", b"{", b"|") or b"|" in line for line in rows) > len(rows) // 2:
        for letter in BRACKETS:
            table[letter] = ord(" ")
    if _has_decimal_commas(path, [line.translate(bytes(table)).strip() for line in rows]):
        table[ord(",")] = ord(".")
    letters = bytes(table)
    return b"" if letters == bytes(range(256)) else letters


def _has_decimal_commas(path: Path, rows: list[bytes]) -> bool:
    """Whether commas stand inside numbers, as in `0,000125;17;203;1`, and other letters between them.

    Raises:
        BadFile: they do, and may as well stand for thousands; or commas stand between numbers in quotes, too.
    """
    if not rows:
        return False
    unclear = 2 * sum(map(_has_both_commas, rows)) > len(rows)
    if not unclear:
        words = [[word.strip(b"\"'") for word in BETWEEN.split(row)] for row in rows]
        if any(len(row) < 4 or any(COMMA.fullmatch(w) is None and b"," in w for w in row) for row in words):
            return False
        places = [match[1] for row in words for word in row if (match := COMMA.fullmatch(word))]
        if 2 * len(places) < len(rows):
            return False
        unclear = all(len(place) == 3 for place in places)
    if unclear:
        raise BadFile(
            f"{path.name}: commas in numbers such as {rows[-1].decode(errors='replace')[:60]!r} may be decimal points, "
            "or stand for thousands",
            fix="export it again with decimal points, and without marks for thousands",
        )
    return True


def _has_both_commas(row: bytes) -> bool:
    """Whether commas stand between the numbers of a line, and within one of them that is in quotes."""
    rest, count = QUOTED_COMMAS.subn(b"0", row)
    return 0 < count < len(rest.split(b","))


def packing(path: Path) -> str:
    """What a file is compressed with: gzip, zstd or nothing."""
    with path.open("rb") as file:
        start = file.read(4)
    return "gzip" if start.startswith(GZIP) else "zstd" if ZSTD.match(start) else ""


def unpacked_start(path: Path, size: int = 4096) -> bytes:
    """The first bytes of a file, decompressed."""
    with _opened(path, packing(path)) as file:
        return _read(file, path, size)


def encoding_of(start: bytes) -> str:
    """UTF-16 by its mark, or by the zeros beside every digit; else nothing."""
    if start.startswith(b"\xff\xfe") or (len(start) > 7 and start[1:8:2] == bytes(4) and start[0]):
        return "utf-16-le"
    if start.startswith(b"\xfe\xff") or (len(start) > 7 and start[0:8:2] == bytes(4) and start[1]):
        return "utf-16-be"
    return ""


def _opened(path: Path, packed: str) -> Any:
    if packed == "gzip":
        return gzip.open(path, "rb")
    return zstd().open(path, "rb") if packed == "zstd" else path.open("rb")


def _read(file: Any, path: Path, size: int) -> bytes:
    """The next bytes; where compressed ones are damaged or cut short the file ends, with a warning."""
    try:
        return file.read1(size)  # of a file cut short, all that can be unpacked
    except Exception as error:
        if not isinstance(error, EOFError | OSError | zlib.error) and type(error).__name__ != "ZstdError":
            raise
        text = f"{path.name} is damaged or cut short ({error}): it is read up to there"
        warnings.warn(text, EvimoWarning, stacklevel=2)
        return b""
