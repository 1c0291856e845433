"""Slices of simulated recordings beside slices of real clips, drawn alike: what gives the simulator away?

    python bench/beside_real.py --simulated replica stress --real CLIP... [--out out/beside_real.jpg] [--most 400]

A row for each folder of simulated recordings, as many of its recordings as there are real clips, spread over it; the
last row are the clips. Of each the slice of 25 ms in the middle of its length.
"""

import argparse
from pathlib import Path

import numpy as np
from contact_sheet import save_small

from evimo.errors import EvimoError
from evimo.events.events import joined
from evimo.events.slices import SLICE_US
from evimo.formats import open_events
from evimo.formats.event_file import EventFile
from evimo.recordings.finding import recordings_in
from evimo.recordings.recording import open_recording
from evimo.viewing.colours import BACKDROP, Image, painted
from evimo.viewing.maps import Zoom, event_levels, polarity_table
from evimo.viewing.strokes import TITLE, write

WIDE, TALL, GAP, LABEL = 260, 196, 6, 90


def picture(recording: EventFile) -> Image:
    """The events of the middle slice, (TALL, WIDE, 3), the sensor's shape kept."""
    start_us = (recording.start_us + recording.stop_us) // 2 // SLICE_US * SLICE_US
    events = joined(list(recording.packets(start_us, start_us + SLICE_US)))
    height, width = recording.sensor
    ratio = min(TALL / height, WIDE / width)
    shown = round(height * ratio), round(width * ratio)
    zoom = Zoom(sensor=recording.sensor, shown=shown)
    image = np.full((TALL, WIDE, 3), BACKDROP, np.uint8)
    zoom.enlarge(painted(event_levels(events, zoom), polarity_table()), into=image[: shown[0], : shown[1]])
    return image


def sheet(rows: dict[str, list[EventFile]]) -> Image:
    """All pictures, a row for each name."""
    most = max(len(row) for row in rows.values())
    image = np.full((len(rows) * (TALL + GAP) + GAP, LABEL + most * (WIDE + GAP), 3), BACKDROP, np.uint8)
    for number, (name, row) in enumerate(rows.items()):
        top = GAP + number * (TALL + GAP)
        write(image, name, (GAP, top + 16), size=TITLE, bold=True)
        for column, recording in enumerate(row):
            left = LABEL + column * (WIDE + GAP)
            image[top : top + TALL, left : left + WIDE] = picture(recording)
    return image


def main() -> None:
    """Choose, draw, save."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--simulated", type=Path, nargs="+", required=True)
    parser.add_argument("--real", type=Path, nargs="+", required=True)
    parser.add_argument("--out", type=Path, default=Path("out/beside_real.jpg"))
    parser.add_argument("--most", type=float, default=400, help="kB")
    options = parser.parse_args()
    try:
        rows: dict[str, list[EventFile]] = {}
        for folder in options.simulated:
            found = recordings_in([folder])
            spread = np.linspace(0, len(found) - 1, min(len(found), len(options.real))).round().astype(int)
            rows[folder.name] = [open_recording(found[k]).events for k in spread]
        rows["real"] = [open_events(path) for path in options.real]
        image = sheet(rows)
    except EvimoError as error:
        raise SystemExit(f"error: {error}") from error
    quality = save_small(image, options.out, most_kb=options.most)
    print(f"{options.out}: {image.shape[1]}x{image.shape[0]} px, quality {quality}")


if __name__ == "__main__":
    main()
