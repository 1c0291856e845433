"""The files that `readers.py` reads: the same made-up events in the binary formats of Prophesee and of cAER."""

import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evimo.events.events import Events
from evimo.formats.saving import save_events

SIZE = (260, 346)
CAMERA_US = 64  # a camera says the upper bits of its clock so often
PACKET = 4096


def write_evt2(folder: Path, events: Events) -> Path:
    """As our simulator stores it."""
    save_events([events], folder / "evt2.raw", size=SIZE)
    return folder / "evt2.raw"


def write_evt21(folder: Path, events: Events) -> Path:
    """One pixel in each word, the upper half of which tells the kind, as openeb calls legacy: the other half first."""
    path = write_evt2(folder, events)
    raw = path.read_bytes()
    words = np.frombuffer(raw, "<u4", offset=raw.index(b"end\n") + 4)
    stored = np.stack([words, words >> 28 < 2], axis=1).astype("<u4")
    stored[:, 0] -= (stored[:, 1] * (words >> 11 & 31)) << 11
    stored[:, 1] <<= words >> 11 & 31
    head = f"% evt 2.1\n% endianness legacy\n% format EVT21;endianness=legacy\n% geometry {SIZE[1]}x{SIZE[0]}\n% end\n"
    (folder / "evt21.raw").write_bytes(head.encode() + stored.tobytes())
    return folder / "evt21.raw"


def write_evt3(folder: Path, events: Events) -> Path:
    """Words as a camera sends them."""
    head = f"% evt 3.0\n% format EVT3;height={SIZE[0]};width={SIZE[1]}\n% geometry {SIZE[1]}x{SIZE[0]}\n% end\n"
    (folder / "evt3.raw").write_bytes(head.encode() + evt3_words(events).tobytes())
    return folder / "evt3.raw"


def evt3_words(events: Events) -> NDArray[np.uint16]:
    """Words where something changes, as a camera sends them: row, lower and, every 64 us, upper bits of the time."""
    new_low = np.diff(events.t, prepend=-1) != 0
    new_high = np.diff(events.t // CAMERA_US, prepend=-1) != 0
    kinds = [
        (new_high, 8 << 12 | events.t >> 12 & 0xFFF),
        (new_low, 6 << 12 | events.t & 0xFFF),
        (np.diff(events.y.astype(int), prepend=-1) != 0, events.y),
        (np.ones(len(events), bool), 2 << 12 | (events.p > 0).astype(int) << 11 | events.x),
    ]
    said = np.stack([kind[0] for kind in kinds], axis=1).ravel()
    return np.stack([np.asarray(kind[1]).astype("<u2") for kind in kinds], axis=1).ravel()[said]


def write_dat(folder: Path, events: Events) -> Path:
    """Version 2."""
    address = events.x.astype(np.uint32) | events.y.astype(np.uint32) << 14 | (events.p > 0).astype(np.uint32) << 28
    records = np.stack([events.t.astype(np.uint32), address], axis=1).astype("<u4")
    head = f"% Data file containing CD events.\n% Version 2\n% Height {SIZE[0]}\n% Width {SIZE[1]}\n"
    (folder / "a.dat").write_bytes(head.encode() + b"\x0c\x08" + records.tobytes())
    return folder / "a.dat"


def write_aedat2(folder: Path, events: Events) -> Path:
    """As jAER stores a DAVIS346: rows from the bottom, columns from the right."""
    x, y = (SIZE[1] - 1 - events.x.astype(np.uint32)), (SIZE[0] - 1 - events.y.astype(np.uint32))
    records = np.stack([y << 22 | x << 12 | (events.p > 0).astype(np.uint32) << 11, events.t], axis=1).astype(">u4")
    head = b"#!AER-DAT2.0\r\n# AEChip: eu.seebetter.ini.chips.davis.Davis346B\r\n#End Of ASCII Header\r\n"
    (folder / "a2.aedat").write_bytes(head + records.tobytes())
    return folder / "a2.aedat"


def write_aedat3(folder: Path, events: Events) -> Path:
    """Packets of 4096 events."""
    data = events.x.astype(np.uint32) << 17 | events.y.astype(np.uint32) << 2 | (events.p > 0).astype(np.uint32) << 1
    records = np.stack([data | 1, events.t.astype(np.uint32)], axis=1).astype("<u4")
    with (folder / "a3.aedat").open("wb") as file:
        file.write(b"#!AER-DAT3.1\r\n#Format: RAW\r\n#Source 1: DAVIS346\r\n#!END-HEADER\r\n")
        for first in range(0, len(records), PACKET):
            part = records[first : first + PACKET]
            file.write(struct.pack("<HHIIIIII", 1, 1, 8, 4, 0, len(part), len(part), len(part)) + part.tobytes())
    return folder / "a3.aedat"
