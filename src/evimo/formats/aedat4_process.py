"""A program of its own that writes AEDAT 4 from what comes in at its standard input: PATH WIDTH HEIGHT.

The library that does it ends its whole process when a disk is full; here, nothing else ends with it. A packet comes as
its number of events, int64, then t int64, x and y uint16 and p int8 of all of them; a negative number is the end. This
file imports nothing of the package, so that it starts fast.
"""

import importlib
import sys
from typing import Any

import numpy as np

PACKET = 10_000  # events of AEDAT 4 are found by packet
COLUMNS = ("<i8", "<u2", "<u2", "|i1")


def main(path: str, width: int, height: int) -> int:
    """Write the file; 1 where the input breaks off."""
    dv: Any = importlib.import_module("dv_processing")
    settings = dv.io.MonoCameraWriter.EventOnlyConfig("evimo", (width, height), dv.CompressionType.LZ4)
    writer, source = dv.io.MonoCameraWriter(path, settings), sys.stdin.buffer
    while (count := int.from_bytes(source.read(8) or b"\0", "little", signed=True)) > 0:
        columns = [np.frombuffer(source.read(count * np.dtype(kind).itemsize), kind) for kind in COLUMNS]
        if len(columns[-1]) < count:
            return 1
        columns[-1] = columns[-1] > 0
        for first in range(0, count, PACKET):
            store = dv.EventStore()
            for event in zip(*(column[first : first + PACKET].tolist() for column in columns), strict=True):
                store.push_back(*event)
            writer.writeEvents(store)
    del writer  # it writes the table of packets when it goes
    return 0 if count < 0 else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3])))
