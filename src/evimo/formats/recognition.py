"""Which format a file is in: by its first bytes, and where those say nothing, by what a user may have meant."""

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Literal

from evimo.errors import BadFile, NotFound
from evimo.formats.prophesee_header import DAT_MARK, RAW_MARK, header_of, sample, words_encoding
from evimo.formats.rosbag2 import METADATA, is_folder_of_bag
from evimo.formats.text_source import encoding_of, packing, unpacked_start
from evimo.geometry.stand_ins import stand_in

Kind = Literal[
    "evimo_npz",
    "evimo2",
    "hdf5",
    "aedat2",
    "aedat3",
    "aedat4",
    "event_stream",
    "rosbag1",
    "rosbag2",
    "prophesee_raw",
    "prophesee_dat",
    "text",
]

SUFFIXES: dict[Kind, tuple[str, ...]] = {
    "evimo_npz": (".npz",),
    "evimo2": (".npy", ".json", ".npz"),
    "hdf5": (".h5", ".hdf5", ".hdf"),
    "aedat2": (".aedat", ".aedat2", ".dat"),
    "aedat3": (".aedat", ".aedat3"),
    "aedat4": (".aedat4",),
    "event_stream": (".es",),
    "rosbag1": (".bag",),
    "rosbag2": (".db3", ".mcap", ".yaml"),
    "prophesee_raw": (".raw",),
    "prophesee_dat": (".dat",),
    "text": (".txt", ".csv", ".tsv", ".dat", ".gz", ".zst", ""),
}
STARTS: dict[bytes, Kind] = {
    b"PK\x03\x04": "evimo_npz",
    b"\x89HDF": "hdf5",
    b"#!AER-DAT2": "aedat2",
    b"#!AER-DAT3": "aedat3",
    b"#!AER-DAT4": "aedat4",
    b"Event Stream": "event_stream",
    b"#ROSBAG V2": "rosbag1",
    b"SQLite format 3": "rosbag2",
    b"\x89MCAP": "rosbag2",
}
# Recognised, and said to be so, until their readers exist.
NOT_YET = {
    b"#!AER-DAT": ("AEDAT 1", "convert it to AEDAT 4 with iniVation's DV software, or to text"),
    b"MATLAB 5.0 MAT-file": (
        "a MATLAB file",
        "write its columns t x y p as text, or as arrays of an .npz or HDF5 file",
    ),
    b"\x93NUMPY": ("a single NumPy array", "save it as numpy.savez(FILE.npz, events=…) with columns t x y p"),
}
NO_RECORDING = {
    b"BZh": ("compressed with bzip2", "bunzip2 it first"),
    b"\xfd7zXZ": ("compressed with xz", "unxz it first"),
    b"\x04\x22\x4d\x18": ("compressed with lz4", "unlz4 it first"),
    b"\x1f\x9d": ("compressed with compress (.Z)", "uncompress it first"),
    b"7z\xbc\xaf": ("a 7-Zip archive", "unpack it first"),
    b"Rar!": ("a RAR archive", "unpack it first"),
    b"PK\x05\x06": ("an empty zip archive", "copy or pack it again"),
    b"\x89PNG": ("a picture", "give an event recording"),
    b"\xff\xd8\xff": ("a picture", "give an event recording"),
}
# Texts of other kinds: what their beginning says they are.
TEXTS = {
    rb"\s*<(\?xml|opencv_storage)": (
        "an XML file, no recording",
        "give an event recording; a calibration goes to --calibration",
    ),
    rb"\s*%YAML": ("a YAML file, no recording", "give an event recording; a calibration goes to --calibration"),
    rb"\s*[{\[]\s*[\"{\[]": (
        "a JSON file, no recording",
        "give an event recording; a calibration goes to --calibration, and events in JSON are to be written as CSV",
    ),
}
TAR_AT, TAR = 257, b"ustar"
PICKLE = re.compile(rb"\x80[\x02-\x05]|\(dp\d|c\w+\n\w+\n")
READABLE = (
    "EV-IMO npz, EVIMO2 folder, HDF5, text or CSV (t x y p), AEDAT 2, 3 and 4, Event Stream (.es), ROS 1 and 2 bags, "
    "Prophesee RAW and DAT"
)


def check_there(paths: Iterable[Path]) -> None:
    """Make sure that there is something at every path, before the first is worked on.

    Raises:
        NotFound: there is nothing.
    """
    for path in paths:
        if not _is_there(path):
            raise NotFound(f"there is no file or folder '{path}'", fix="check the path")


def _is_there(path: Path) -> bool:
    try:
        return path.exists()
    except OSError:  # of a name that is too long, in Python before 3.14
        return False


def recognised(path: Path) -> Kind:
    """The format of a recording, from its content.

    Raises:
        NotFound: there is nothing.
        BadFile: empty, not readable yet, or no event recording.
    """
    check_there([path])
    if path.is_dir() or (path.name.startswith("dataset_") and (path.parent / "dataset_events_t.npy").exists()):
        return _folder(path if path.is_dir() else path.parent)
    if not path.is_file():
        raise BadFile(
            f"{path} is a pipe or a device: a recording is read more than once, and from the middle",
            fix="save it as a file first",
        )
    if path.name == METADATA and is_folder_of_bag(path.parent):
        return "rosbag2"
    start = _start(path)
    _refuse_tar(path, start)
    if packing(path):
        return _packed(path)
    for magic, kind in STARTS.items():
        if start.startswith(magic):
            return kind
    for magic, (what, fix) in NOT_YET.items():
        if start.startswith(magic):
            raise BadFile(f"{path.name} is {what}, which is not supported yet", fix=fix)
    for magic, (what, fix) in NO_RECORDING.items():
        if start.startswith(magic):
            raise BadFile(f"{path.name} is {what}", fix=fix)
    if PICKLE.match(start):
        raise BadFile(
            f"{path.name} is a Python pickle, which may run code: it was not opened", fix=f"give one of: {READABLE}"
        )
    return _text_or_prophesee(path, start)


def _packed(path: Path) -> Kind:
    """Text, if that is what was compressed.

    Raises:
        BadFile: another file was.
    """
    inside = unpacked_start(path)
    if inside and not _binary(inside):
        return _text_or_prophesee(path, inside)
    _refuse_tar(path, inside)
    packed = packing(path)
    if not inside:
        raise BadFile(f"{path.name} is compressed with {packed}, and holds nothing", fix="copy or pack it again")
    fix = {"gzip": "gunzip it first", "zstd": "unzstd it first"}[packed]
    raise BadFile(f"{path.name} is compressed with {packed}, and no text", fix=fix)


def _refuse_tar(path: Path, start: bytes) -> None:
    """Refuse several files in one.

    Raises:
        BadFile: the bytes are the beginning of a tar archive.
    """
    if start[TAR_AT : TAR_AT + len(TAR)] == TAR:
        raise BadFile(f"{path.name} is a tar archive of several files", fix=f"unpack it first: tar xf {path.name}")


def _start(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            start = file.read(4096)
    except OSError as error:
        raise BadFile(f"{path.name} cannot be read: {error.strerror}", fix="check its permissions") from error
    if not start:
        raise BadFile(f"{path.name} is empty (0 bytes)", fix="copy or record it again")
    return start


def _folder(path: Path) -> Kind:
    if (path / "dataset_events_t.npy").exists():
        return "evimo2"
    if is_folder_of_bag(path):
        return "rosbag2"
    raise BadFile(
        f"the folder {path} holds no EVIMO2 recording (dataset_events_t.npy) and no ROS 2 bag (db3, mcap)",
        fix="give the recording's own file",
    )


def _text_or_prophesee(path: Path, start: bytes) -> Kind:
    """Prophesee's files open with lines of `% key value` before bytes, or with none; text may open with such too.

    Raises:
        BadFile: it is neither.
    """
    named = (words for form, words in TEXTS.items() if re.match(form, start.lstrip(b"\xef\xbb\xbf"), re.IGNORECASE))
    if words := stand_in(start) or next(named, None):
        raise BadFile(f"{path.name} is {words[0]}", fix=words[1])
    head = header_of(start)
    lines, body = start[: head.length], start[head.length :]
    if DAT_MARK.search(lines) and (_binary(body) or not body):
        return "prophesee_dat"
    if RAW_MARK.search(lines) or ({"format", "Version"} & head.fields.keys() and _binary(body)):
        return "prophesee_raw"
    if not _binary(start):
        return "text"
    if words_encoding(sample(path, head.length)):
        return "prophesee_raw"
    raise BadFile(
        f"{path.name} is no event recording: its content is of no known format", fix=f"give one of: {READABLE}"
    )


def _binary(start: bytes) -> bool:
    """Whether bytes are there that text does not have."""
    if encoding := encoding_of(start):
        start = start[: len(start) // 2 * 2].decode(encoding, errors="replace").encode()
    return bool(re.search(rb"[^\t\n\r\f\x20-\x7e\x80-\xff]", start))
