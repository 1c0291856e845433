"""Speed of every reader on the same made-up events: `python bench/readers.py [millions of events] [formats]`.

Prints a table of million events per second: to open (the first pass, where a format needs one), to read all, and to
read all by the clock on the wall; the fastest reader of others that is installed (`public_readers.py`); and two plain
reads of the same bytes from the page cache, by the events that they hold, with the share of each that reading reaches.
*Whole* is into memory that the system gives anew each time, as `open(FILE, "rb").read()` does it; *in blocks* is
`readinto` of one buffer as large as a block of the RAW reader's, again and again, so that nothing reaches memory.
For packed formats follows what their library takes to unpack them, with nothing decoded (`unpacking.py`).
Best of several by processor time of this one process, after a warm-up. FORMATS are beginnings of names, separated by
semicolons. The last line is what writing the decoded columns alone takes, which no reader can do without.
"""

import mmap
import struct
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from bag_files import write_bag1, write_bag2
from public_readers import readers_of
from reader_files import write_aedat2, write_aedat3, write_dat, write_evt2, write_evt3, write_evt21
from unpacking import unpacking_of

from evimo.errors import EvimoWarning
from evimo.events.events import Events
from evimo.formats import open_events
from evimo.formats.word_file import BLOCK_BYTES

WIDTH, HEIGHT, RATE_PER_S, REPEATS, PART, MILLIONS = 346, 260, 2_000_000, 5, 20_000, 20
DECODED = ("u2", "u2", "i8", "i1")  # x y t p of an event


def made_up(count: int) -> Events:
    """Sorted events at a steady rate, spread over the sensor."""
    draw = np.random.default_rng(0)
    t = np.sort(draw.integers(0, count * 1_000_000 // RATE_PER_S, count))
    x, y = draw.integers(0, WIDTH, count, np.uint16), draw.integers(0, HEIGHT, count, np.uint16)
    return Events(x, y, t, draw.choice(np.array([-1, 1], np.int8), count))


def rows(events: Events) -> np.ndarray:
    """Rows t x y p, seconds, p in {0, 1}."""
    return np.stack([events.t * 1e-6, events.x, events.y, events.p > 0], axis=1)


def write_npz(folder: Path, events: Events, *, packed: bool) -> Path:
    """As EV-IMO stores it."""
    save = np.savez_compressed if packed else np.savez
    save(folder / f"packed_{packed}.npz", events=rows(events).astype(np.float32), depth=np.zeros((1, HEIGHT, WIDTH)))
    return folder / f"packed_{packed}.npz"


def write_evimo2(folder: Path, events: Events) -> Path:
    """As EVIMO2 and our simulator store it."""
    np.save(folder / "dataset_events_t.npy", events.t * 1e-6)
    np.save(folder / "dataset_events_xy.npy", np.stack([events.x, events.y], axis=1))
    np.save(folder / "dataset_events_p.npy", (events.p > 0).astype(np.uint8))
    np.savez(folder / "dataset_depth.npz", depth_0000000000=np.zeros((HEIGHT, WIDTH), np.uint16))
    return folder


def write_text(folder: Path, events: Events) -> Path:
    """As NumPy prints it."""
    np.savetxt(folder / "a.txt", rows(events), fmt="%.9f %d %d %d")
    return folder / "a.txt"


def write_csv(folder: Path, events: Events) -> Path:
    """As pandas and Metavision write it, whole µs."""
    columns = np.stack([events.t, events.x, events.y, events.p > 0], axis=1)
    np.savetxt(folder / "a.csv", columns, fmt="%d", delimiter=",", header="t,x,y,p", comments="")
    return folder / "a.csv"


def write_hdf5(folder: Path, events: Events, *, packed: bool) -> Path:
    """As DSEC stores it, with blosc or as plain arrays."""
    import h5py
    import hdf5plugin

    how = {"chunks": (1 << 16,), **hdf5plugin.Blosc(cname="zstd", clevel=5)} if packed else {}
    path = folder / "a.h5"
    with h5py.File(path, "w") as file:
        for name, kind in (("x", "u2"), ("y", "u2"), ("t", "u4"), ("p", "u1")):
            column = (events.p > 0) if name == "p" else getattr(events, name)
            file.create_dataset(f"events/{name}", data=column.astype(kind), **how)
        file["t_offset"] = 0
        file["ms_to_idx"] = np.searchsorted(events.t, np.arange(0, events.t[-1] // 1000 + 1) * 1000)
    return path


def write_event_stream(folder: Path, events: Events) -> Path:
    """One byte of time step each: no two events are 127 µs apart."""
    stored = np.zeros(len(events), [("t", "u1"), ("x", "<u2"), ("y", "<u2")])
    stored["t"] = np.diff(events.t, prepend=0).clip(0, 126) << 1 | (events.p > 0)
    stored["x"], stored["y"] = events.x, HEIGHT - 1 - events.y
    head = b"Event Stream\x02\0\0\x01" + struct.pack("<HH", WIDTH, HEIGHT)
    (folder / "a.es").write_bytes(head + stored.tobytes())
    return folder / "a.es"


def write_aedat4(folder: Path, events: Events) -> Path:
    """Through iniVation's library."""
    import dv_processing

    config = dv_processing.io.MonoCameraWriter.EventOnlyConfig("camera", (WIDTH, HEIGHT))
    writer = dv_processing.io.MonoCameraWriter(str(folder / "a.aedat4"), config)
    for first in range(0, len(events), PART):
        store, part = dv_processing.EventStore(), events.part(first, first + PART)
        for event in zip(part.t.tolist(), part.x.tolist(), part.y.tolist(), (part.p > 0).tolist(), strict=True):
            store.push_back(*event)
        writer.writeEvents(store)
    del writer
    return folder / "a.aedat4"


FORMATS: dict[str, Callable[[Path, Events], Path]] = {
    "EV-IMO npz, compressed": lambda folder, events: write_npz(folder, events, packed=True),
    "EV-IMO npz, stored": lambda folder, events: write_npz(folder, events, packed=False),
    "EVIMO2 folder": write_evimo2,
    "text, seconds": write_text,
    "CSV, µs": write_csv,
    "HDF5 (DSEC, blosc)": lambda folder, events: write_hdf5(folder, events, packed=True),
    "HDF5, plain": lambda folder, events: write_hdf5(folder, events, packed=False),
    "AEDAT 4 (LZ4)": write_aedat4,
    "AEDAT 3": write_aedat3,
    "AEDAT 2": write_aedat2,
    "RAW, EVT 2.0": write_evt2,
    "RAW, EVT 2.1": write_evt21,
    "RAW, EVT 3.0": write_evt3,
    "DAT": write_dat,
    "Event Stream": write_event_stream,
    "ROS 1 bag, dvs_msgs": partial(write_bag1, encoding="array"),
    "ROS 1 bag, mono": partial(write_bag1, encoding="mono"),
    "ROS 1 bag, evt3": partial(write_bag1, encoding="evt3"),
    "ROS 2 bag, db3, dvs_msgs": partial(write_bag2, encoding="array", storage="db3"),
    "ROS 2 bag, db3, mono": partial(write_bag2, encoding="mono", storage="db3"),
    "ROS 2 bag, db3, evt3": partial(write_bag2, encoding="evt3", storage="db3"),
    "ROS 2 bag, mcap, dvs_msgs": partial(write_bag2, encoding="array", storage="mcap"),
    "ROS 2 bag, mcap, evt3": partial(write_bag2, encoding="evt3", storage="mcap"),
    "ROS 2 bag, mcap lz4, dvs_msgs": partial(write_bag2, encoding="array", storage="mcap lz4"),
    "ROS 2 bag, mcap zstd, dvs_msgs": partial(write_bag2, encoding="array", storage="mcap zstd"),
}


class Took(NamedTuple):
    """Seconds that something took, of the processor and by the clock on the wall: each the shortest of several runs."""

    cpu: float
    wall: float


def took(function: Callable[[], object]) -> Took:
    """Run it several times, after once to warm up."""
    times = []
    for _ in range(REPEATS + 1):
        cpu, wall = time.process_time(), time.perf_counter()
        function()
        times.append((time.process_time() - cpu, time.perf_counter() - wall))
    return Took(*(max(min(each), 1e-6) for each in zip(*times[1:], strict=True)))


def read_by_us(path: Path, count: int) -> Took:
    """To read all, once it is open."""
    recording = open_events(path)

    def read() -> None:
        seen = sum(len(packet) for packet in recording)
        assert seen > 0.999 * count, f"{path}: {seen} of {count}"

    return took(read)


def fastest_public(name: str, path: Path, count: int) -> str:
    """The fastest reader of others, in million events per second; those that fail or miss events do not count."""
    found: list[tuple[float, str]] = []
    for reader in readers_of(name):
        try:
            if abs(reader(path) - count) < 0.001 * count:
                found.append((count * 1e-6 / took(lambda reader=reader: reader(path)).cpu, reader.__name__))
        except Exception as error:
            print(f"{reader.__name__}: {type(error).__name__}: {str(error)[:100]}", file=sys.stderr)
    return "{:.1f} ({})".format(*max(found)) if found else "–"


def files_of(path: Path) -> list[Path]:
    """The file, or those in a folder."""
    return list(path.iterdir()) if path.is_dir() else [path]


def whole(path: Path) -> int:
    """Read all bytes into memory that the system gives anew: what Python gave back it may keep for the next time."""
    total = 0
    for each in files_of(path):
        with (
            each.open("rb", buffering=0) as file,
            mmap.mmap(-1, each.stat().st_size, access=mmap.ACCESS_COPY) as memory,
        ):
            total += file.readinto(memory)
    return total


def in_blocks(path: Path) -> int:
    """Read all bytes into one buffer."""
    buffer, count = bytearray(BLOCK_BYTES), 0
    for each in files_of(path):
        with each.open("rb", buffering=0) as file:
            while more := file.readinto(buffer):
                count += more
    return count


def written(count: int) -> None:
    """Write the columns of as many events, in packets as the RAW reader's."""
    packet = BLOCK_BYTES // 4
    sources = [np.zeros(packet, kind) for kind in DECODED]
    for _ in range(0, count, packet):
        for source in sources:
            np.copyto(np.empty_like(source), source)


def main() -> None:
    """Write, open and read each format."""
    count = int(float(sys.argv[1] if len(sys.argv) > 1 else MILLIONS) * 1e6)
    wanted = tuple((sys.argv[2] if len(sys.argv) > 2 else "").split(";"))
    warnings.simplefilter("ignore", EvimoWarning)
    events, millions = made_up(count), count * 1e-6
    heads = ("format", "bytes per event", "open", "read", "by the wall", "fastest of others", "plain, whole", "share")
    print(f"| {' | '.join((*heads, 'plain, in blocks', 'share', 'unpacked', 'share'))} |\n|---|{'---:|' * 11}")
    for name, write in FORMATS.items():
        if not name.startswith(wanted):
            continue
        with tempfile.TemporaryDirectory() as folder:
            path = write(Path(folder), events)
            size = whole(path)
            opening, reading = took(partial(open_events, path)), read_by_us(path, count)
            at_once, blocks = took(partial(whole, path)), took(partial(in_blocks, path))
            others = fastest_public(name, path, count)
            unpack = unpacking_of(name)
            unpacking = took(partial(unpack, path)) if unpack else None
        ours = f"{millions / opening.cpu:,.0f} | {millions / reading.cpu:.0f} | {millions / reading.wall:.0f}"
        floors = (at_once, blocks, unpacking)
        plain = (f"{millions / each.cpu:,.0f} | {each.cpu / reading.cpu:.0%}" if each else "– | –" for each in floors)
        print(f"| {name} | {size / count:.1f} | {ours} | {others} | {' | '.join(plain)} |", flush=True)
    floor = took(partial(written, count))
    print(f"\nwriting the columns: {millions / floor.cpu:,.0f}, by the wall {millions / floor.wall:,.0f}")


if __name__ == "__main__":
    main()
