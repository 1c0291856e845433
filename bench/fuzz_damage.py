"""How `fuzz.py` damages bytes: in one to eight places, and inside archives with their check sums made right again."""

import io
import zipfile
from collections.abc import Callable

import numpy as np

NUMBERS = (b"nan", b"inf", b"-1", b"1e400", b"99999999999999999999", b"0x7f", b"1_0", b"\xc2\xb2", b"", b"True")


def bit_flipped(data: bytearray, rng: np.random.Generator) -> None:
    """One bit."""
    data[rng.integers(len(data))] ^= 1 << int(rng.integers(8))


def byte_set(data: bytearray, rng: np.random.Generator) -> None:
    """One byte, to anything or to an end of its range."""
    data[rng.integers(len(data))] = int(rng.choice([0, 255, 127, 128, 10, 32, int(rng.integers(256))]))


def word_set(data: bytearray, rng: np.random.Generator) -> None:
    """Four or eight bytes, to what lengths and offsets should never be."""
    width = int(rng.choice([4, 8]))
    at = int(rng.integers(max(1, len(data) - width + 1)))
    value = int(rng.choice([0, 1, 2 ** (8 * width - 1) - 1, 2**31 - 1, 2**32 - 1, 2**20], shuffle=False)) % 2 ** (
        8 * width
    )
    data[at : at + width] = value.to_bytes(width, str(rng.choice(["little", "big"])))[: len(data) - at]  # type: ignore[arg-type]


def cut(data: bytearray, rng: np.random.Generator) -> None:
    """Everything behind some place."""
    del data[int(rng.integers(len(data))) :]


def removed(data: bytearray, rng: np.random.Generator) -> None:
    """A stretch of bytes."""
    at = int(rng.integers(len(data)))
    del data[at : at + int(rng.integers(1, 65))]


def repeated(data: bytearray, rng: np.random.Generator) -> None:
    """A stretch, once more at another place."""
    at, to = (int(rng.integers(len(data))) for _ in range(2))
    data[to:to] = data[at : at + int(rng.integers(1, 4097))]


def noise(data: bytearray, rng: np.random.Generator) -> None:
    """A stretch, overwritten by anything."""
    at = int(rng.integers(len(data)))
    length = min(int(rng.integers(1, 257)), len(data) - at)
    data[at : at + length] = rng.bytes(length)


def word_replaced(data: bytearray, rng: np.random.Generator) -> None:
    """What stands between two separators of a text, by a number that is none or too large."""
    at = int(rng.integers(len(data)))
    ends = [place for mark in b" ,;:\n[]" if (place := data.find(mark, at)) >= 0]
    data[at : min(ends, default=len(data))] = NUMBERS[int(rng.integers(len(NUMBERS)))]


MUTATIONS: tuple[Callable[[bytearray, np.random.Generator], None], ...] = (
    bit_flipped,
    byte_set,
    word_set,
    cut,
    removed,
    repeated,
    noise,
    word_replaced,
)


def changed(content: bytes, rng: np.random.Generator) -> bytes:
    """The same, changed in one to eight places, mostly near its beginning."""
    data = bytearray(content)
    for _ in range(int(rng.integers(1, 9))):
        if not data:
            break
        front = int(min(len(data), rng.choice([64, 1024, len(data)])))
        part = data[:front]
        MUTATIONS[int(rng.integers(len(MUTATIONS)))](part, rng)
        data[:front] = part
    return bytes(data)


def repacked(archive: bytes, rng: np.random.Generator) -> bytes:
    """An archive with one damaged member and the right check sums, which else end the reading of it early."""
    packed = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(archive)) as old, zipfile.ZipFile(packed, "w") as new:
        chosen = str(rng.choice(sorted(old.namelist())))
        for name in old.namelist():
            content = old.read(name)
            new.writestr(zipfile.ZipInfo(name), changed(content, rng) if name == chosen else content)
    return packed.getvalue()
