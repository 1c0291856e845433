"""PLY headers, as far as it takes to make scans readable for trimesh."""

import re

SIZES = {
    b"char": 1, b"uchar": 1, b"short": 2, b"ushort": 2, b"int": 4, b"uint": 4, b"float": 4, b"double": 8,
    b"int8": 1, b"uint8": 1, b"int16": 2, b"uint16": 2, b"int32": 4, b"uint32": 4, b"float32": 4, b"float64": 8,
}  # fmt: skip
"""Bytes of a property's type in binary files."""

HEADER = re.compile(rb".*?^end_header\r?\n", re.DOTALL | re.MULTILINE)


def plain_ply(content: bytes) -> bytes:
    """A PLY without elements of which there are none, and without bytes beyond its end.

    trimesh refuses both, and scanners' programs write them.
    """
    header = HEADER.match(content)
    if header is None:
        return content
    kept: list[bytes] = []
    number = 1
    length: int | None = 0
    for line in header[0].splitlines(keepends=True):
        words = line.split() or [b""]
        if words[0] == b"element":
            number = int(words[2])
        if number or words[0] not in (b"element", b"property"):
            kept.append(line)
        if words[0] == b"property" and number:
            length = None if length is None or words[1] not in SIZES else length + number * SIZES[words[1]]
    binary = any(line.startswith(b"format binary") for line in kept)
    stop = header.end() + length if binary and length is not None else len(content)
    return b"".join(kept) + content[header.end() : stop]
