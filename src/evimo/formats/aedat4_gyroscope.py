"""The gyroscope of an AEDAT 4 recording: its stream of IMU samples."""

import warnings
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from evimo.errors import EvimoWarning
from evimo.events.gyroscope import Gyroscope, gyroscope_of
from evimo.formats.aedat4_packets import Head, PacketTable, packet_rates, walked


def packet_gyroscope(path: Path, top: Head, table: PacketTable | None, events: int) -> Gyroscope | None:
    """The gyroscope of the camera whose events are read, in its own axes; None where there is none.

    Damaged packets are left out with a warning.
    """
    camera = top.streams[events].camera
    streams = [name for name, stream in top.streams.items() if stream.kind == "IMUS"]
    chosen = next((name for name in streams if top.streams[name].camera == camera), streams[0] if streams else None)
    if chosen is None:
        return None
    walk = walked(path, top.first_packet, path.stat().st_size) if table is None else ()
    offsets: Iterable[int] = table.of(chosen).offset.tolist() if table else (at for at, name in walk if name == chosen)
    times, rates, damaged = [np.zeros(0, np.int64)], [np.zeros((0, 3))], 0
    with path.open("rb") as file:
        for offset in offsets:
            try:
                time, rate = packet_rates(file, offset, top.compression)
            except ValueError:
                damaged += 1
                continue
            times.append(time)
            rates.append(rate)
    if damaged:
        text = f"{path.name}: {damaged:,} packets of IMU samples are damaged and left out"
        warnings.warn(text, EvimoWarning, stacklevel=4)
    rate = np.radians(np.concatenate(rates))
    source = f"IMU of {top.streams[chosen].camera or path.name}"
    return gyroscope_of(np.concatenate(times), rate, in_camera_axes=False, source=source)
