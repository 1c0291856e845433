"""EV-IMO's archives: which there are, how large, and how each is fetched, in pieces that are never fetched twice."""

import gzip
import hashlib
import os
import re
import shutil
import warnings
import zlib
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from http.client import HTTPException, HTTPResponse
from pathlib import Path
from typing import Any, BinaryIO, Literal
from urllib.error import HTTPError, URLError
from urllib.parse import urlsplit
from urllib.request import Request, urlopen

from evimo.errors import BadFile, BadInput, EvimoError, EvimoWarning
from evimo.locks import locked, remove
from evimo.recordings.splits import splits
from evimo.writing import save_text

Kind = Literal["raw", "npz", "txt"]
HOST = "https://obj.umiacs.umd.edu"
SUMS = "SHA256SUMS"
CHUNK_BYTES = 1 << 20
TIMEOUT_S = 30
PASSING = (408, 425, 429)  # what a server says that may say otherwise later
AGAIN = "the same command again, which goes on where it stopped"

# GB as the dataset's page rounds them: bags, npz, text.
SIZES_GB = {
    "eval/box": (0.6, 0.5, 0.7),
    "eval/floor": (0.1, 0.1, 0.1),
    "eval/wall": (1.2, 0.9, 1.4),
    "eval/table": (0.7, 0.6, 0.8),
    "eval/tabletop": (0.3, 0.2, 0.4),
    "eval/fast": (0.6, 0.5, 0.7),
    "train/box": (7, 5, 9),
    "train/floor": (3, 2, 3),
    "train/wall": (2, 1, 2),
    "train/table": (4, 3, 5),
    "train/tabletop": (3, 2, 4),
    "train/tabletop-egomotion": (2, 2, 2),
    "train/basic": (5, 4, 6),
}


@dataclass(frozen=True, slots=True)
class DatasetArchive:
    """One archive. name: `eval/box`. gb: its size, rounded. url: where it is."""

    name: str
    gb: float
    url: str

    @property
    def file(self) -> str:
        """The name of the file."""
        return self.url.rpartition("/")[2]


def archives(wanted: Sequence[str], kind: Kind, *, host: str = HOST) -> list[DatasetArchive]:
    """The archives of these names: `eval/box`, `eval` or `train`, or a published split; all without any.

    Raises:
        BadInput: no such name.
    """
    names: dict[str, None] = {}
    for word in wanted or ("train", "eval"):
        split = splits().get(word, {"train": [], "test": []})
        found = [
            name for name in SIZES_GB if word in (name, name.split("/")[0]) or name in split["train"] + split["test"]
        ]
        if not found:
            raise BadInput(f"no archive {word!r}", fix=f"train, eval, paper2019, or one of {', '.join(SIZES_GB)}")
        names.update(dict.fromkeys(found))
    column = ("raw", "npz", "txt").index(kind)
    return [
        DatasetArchive(name, SIZES_GB[name][column], f"{host}/evimo1{kind}/{name.replace('/', '_')}_{kind}.tar.gz")
        for name in names
    ]


def fetch(archive: DatasetArchive, folder: Path, progress: Callable[[int], object]) -> Path:
    """Fetch one archive, from where an earlier try stopped, and check it against its sums.

    Nobody has published sums of these archives. What is checked is that of their own content (CRC-32 in gzip), and
    from the second time on what SHA256SUMS in the folder says, which the first one writes.

    Args:
        archive: to fetch. folder: for it, which exists. progress: gets bytes as they arrive, those from before first.

    Raises:
        EvimoError: no network, or the server does not have it. BadFile: it arrived damaged. BadInput: the disk is full,
            or another process fetches the same archive.
    """
    fetching = folder / f".{archive.file}.fetching"
    lock: BinaryIO | None = None
    try:
        lock = _lock_of(archive, fetching)
        target = folder / archive.file
        if target.exists():
            progress(target.stat().st_size)
        else:
            _fetch_anew(archive, target, progress)
        _check_sum(target)
        return target
    finally:
        if lock is None:  # a signal came as it was made, or another process has it
            with suppress(OSError):
                lock = locked(fetching, unsure=False)
        if lock is not None:
            remove(fetching, lock)


def _lock_of(archive: DatasetArchive, fetching: Path) -> BinaryIO:
    """The lock of the hidden folder, which is made; anew where another process ends and removes it meanwhile.

    Raises:
        BadInput: another process has it.
    """
    while True:
        with suppress(FileExistsError):
            fetching.mkdir()
        with suppress(FileNotFoundError):
            if (lock := locked(fetching, unsure=True)) is not None:
                return lock
            problem = f"another process fetches {archive.file} to {fetching.parent}"
            raise BadInput(problem, fix="wait for it, or another --out")


def _fetch_anew(archive: DatasetArchive, target: Path, progress: Callable[[int], object]) -> None:
    part, host = target.with_name(f"{target.name}.part"), urlsplit(archive.url).hostname
    have = part.stat().st_size if part.exists() else 0
    try:
        answer = _asked(archive, have)
    except HTTPError as error:
        fix = AGAIN if error.code in PASSING or error.code >= 500 else "another --kind or --mirror"
        raise EvimoError(f"{archive.url}: the server says {error.code} {error.reason}", fix=fix) from error
    except (URLError, HTTPException, TimeoutError, ConnectionError) as error:
        why = getattr(error, "reason", error)
        raise EvimoError(f"no network: {host} cannot be reached ({why})", fix=AGAIN) from error
    try:
        if answer is None:
            progress(have)
        else:
            _append(answer, part, have, progress)
    except (HTTPException, TimeoutError, ConnectionError) as error:
        raise EvimoError(f"the connection to {host} broke off: {error}", fix=AGAIN) from error
    except OSError as error:
        raise BadInput(f"{part} cannot be written: {error.strerror}", fix="more room on the disk") from error
    _check_content(part)
    os.replace(part, target)


def _asked(archive: DatasetArchive, have: int) -> HTTPResponse | None:
    """The server's answer, asked for what is missing; None where nothing is."""
    request = Request(archive.url, headers={"Range": f"bytes={have}-"} if have else {})
    try:
        return _arrived(lambda: urlopen(request, timeout=TIMEOUT_S))
    except HTTPError as error:
        if have and error.code == 416:
            return None
        raise


def _append(answer: HTTPResponse, part: Path, have: int, progress: Callable[[int], object]) -> None:
    """Write what arrives behind what is there, or anew where the server sends it from its beginning."""
    with answer:
        said = answer.headers.get("Content-Range") or f"bytes {have}-"
        kept = have if answer.status == 206 and re.match(rf"bytes {have}-", said) else 0
        if kept < have:
            text = f"the server sends {part.stem} from its beginning: {have:,} bytes are fetched again"
            warnings.warn(text, EvimoWarning, stacklevel=4)
        length = answer.headers.get("Content-Length") or ""
        total = kept + (int(length) if length.isdecimal() else 0)
        free = shutil.disk_usage(part.parent).free
        if total - kept > free:
            text = f"{part.stem} needs {(total - kept) / 1e9:.3g} GB, {part.parent} has {free / 1e9:.3g} GB"
            raise BadInput(text, fix="another --out, or more room on the disk")
        progress(kept)
        with part.open("ab" if kept else "wb") as file:
            while chunk := _arrived(lambda: answer.read(CHUNK_BYTES)):
                file.write(chunk)
                progress(len(chunk))
    if total and part.stat().st_size < total:
        raise ConnectionError(f"{part.stem} stopped after {part.stat().st_size:,} of {total:,} bytes")


def _arrived(from_network: Callable[[], Any]) -> Any:
    """What comes through the network, whose errors would else be taken for those of the disk, such as one of SSL."""
    try:
        return from_network()
    except (URLError, TimeoutError):
        raise
    except OSError as error:
        raise ConnectionError(str(error)) from error


def _check_content(part: Path) -> None:
    """Unpack to nowhere: gzip ends with a sum of what it holds.

    Raises:
        BadFile: it is another; the damaged file is removed, so that it is fetched anew.
    """
    try:
        with gzip.open(part) as file:
            while file.read(CHUNK_BYTES):
                pass
    except (OSError, EOFError, zlib.error) as error:
        part.unlink()
        raise BadFile(f"{part.name} arrived damaged ({error}) and is removed", fix="the same command again") from error


def _check_sum(path: Path) -> None:
    """Compare with SHA256SUMS, or add a line to it.

    Raises:
        BadFile: the file is no longer what it was.
    """
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while chunk := file.read(CHUNK_BYTES):
            digest.update(chunk)
    sums = path.with_name(SUMS)
    lines = sums.read_text().splitlines() if sums.exists() else []
    known = {line[66:]: line[:64] for line in lines if len(line) > 66}
    if path.name not in known:
        save_text("\n".join([*lines, f"{digest.hexdigest()}  {path.name}"]) + "\n", sums)
    elif known[path.name] != digest.hexdigest():
        raise BadFile(f"{path} is not what {SUMS} says", fix=f"remove it, and {AGAIN}")
