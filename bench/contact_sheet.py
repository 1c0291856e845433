"""One row of pictures for each of the paper's six sets, from simulated recordings.

    python bench/contact_sheet.py DIR [--out docs/simulated_sets.jpg] [--most 400]

DIR holds recordings made by `evimo simulate`. Of each set the first recording is taken in whose middle slice an object
is in view. The JPEG has the best quality that keeps it below so many kB.
"""

import argparse
from pathlib import Path

import cv2
import numpy as np

from evimo.errors import EvimoError, NotFound
from evimo.events.events import joined
from evimo.events.slices import SLICE_US, Slice
from evimo.recordings.recording import Recording, open_recording
from evimo.scene.drawing.scenes import SETS
from evimo.simulate.pictures import pictures
from evimo.viewing import legends
from evimo.viewing.colours import BACKDROP, MUTED, Image
from evimo.viewing.history import FLOW_STEPS, round_limit
from evimo.viewing.layout import Box
from evimo.viewing.maps import Zoom
from evimo.viewing.painter import Painter
from evimo.viewing.strokes import TITLE, write
from evimo.viewing.truth_panels import (
    ARROWS,
    TrueSlice,
    TruthReader,
    depth_bounds,
    flow_speed,
    paint_truth,
    truth_titles,
)
from evimo.writing import new_file

COLUMNS = ("intensity", "events", "objects", "depth", "flow")
PANEL = 300  # px wide
LABEL, TITLES, GAP, MARGIN = 164, 34, 8, 12
WHEEL = 124


def chosen(folder: Path) -> dict[int, Recording]:
    """For each set the first recording whose middle slice shows an object, else its first one.

    Raises:
        NotFound: the folder lacks a set.
    """
    found: dict[int, list[Recording]] = {}
    for file in sorted(folder.glob("*/dataset_info.json")):
        recording = open_recording(file.parent)
        found.setdefault(int(recording.meta["set"]), []).append(recording)
    if missing := SETS.keys() - found.keys():
        numbers = ", ".join(map(str, sorted(missing)))
        raise NotFound(f"no recording of set {numbers} in {folder}", fix=f"evimo simulate --minutes 0.1 --out {folder}")
    return {
        number: next((one for one in found[number] if one.truth(len(one) // 2).ids.any()), found[number][0])
        for number in SETS
    }


def middle(recording: Recording) -> TrueSlice:
    """The middle slice, with the picture if it can be rendered again."""
    k = len(recording) // 2
    truth, light = recording.truth(k), pictures(recording)
    index = truth.t_us // SLICE_US
    start_us, stop_us = index * SLICE_US, (index + 1) * SLICE_US
    part = Slice(index, start_us, stop_us, joined(list(recording.events.packets(start_us, stop_us))))
    return TruthReader(recording.camera).slice(part, truth, None if light is None else light(truth.t_us))


def sheet(slices: dict[int, TrueSlice]) -> Image:
    """All rows under one row of titles."""
    height, width = slices[1].truth.ids.shape
    shown = round(height * PANEL / width), PANEL
    columns = COLUMNS if all(one.light is not None for one in slices.values()) else COLUMNS[1:]
    lefts = [MARGIN + LABEL + column * (PANEL + GAP) for column in range(len(columns))]
    tall = MARGIN + TITLES + len(slices) * (shown[0] + GAP)
    image = np.full((tall, lefts[-1] + PANEL + MARGIN, 3), BACKDROP, np.uint8)
    bounds = depth_bounds(one.truth for one in slices.values())
    headers = {name: Box(left, MARGIN, PANEL, TITLES) for name, left in zip(columns, lefts, strict=True)}
    truth_titles(image, headers, bounds=bounds)
    for row, (number, one) in enumerate(slices.items()):
        top = MARGIN + TITLES + row * (shown[0] + GAP)
        panels = {name: Box(header.x, top, PANEL, shown[0]).of(image) for name, header in headers.items()}
        speeds = [float(np.linalg.norm(mark.velocity)) for mark in one.moment.marks]
        limits = round_limit(max(speeds, default=0)), round_limit(flow_speed(one), least=10, steps=FLOW_STEPS)
        painter = Painter(Zoom(sensor=one.truth.ids.shape, shown=shown))
        paint_truth(painter, panels, one, bounds=bounds, limits=limits)
        label(image, (MARGIN, top), number, flow_limit=limits[1])
    under = MARGIN + TITLES + shown[0]
    legends.wheel(image, Box(MARGIN, under - WHEEL, LABEL - GAP, WHEEL))
    for line, text in enumerate(("in the pictures:", ARROWS)):
        write(image, text, (MARGIN, under + GAP + shown[0] - 36 + 18 * line), colour=MUTED)
    return image


def label(image: Image, at: tuple[int, int], number: int, *, flow_limit: float) -> None:
    """What the set is, at the left of its row, in place."""
    style, (x, y) = SETS[number], at
    write(image, f"Set {number}", (x, y + 10), size=TITLE, bold=True)
    movers = f"{min(style.movers)} to {max(style.movers)}" if len(style.movers) > 1 else f"{style.movers[0]}"
    lines = [", ".join(style.rooms), f"{style.pace} speed", f"{movers} objects" if movers != "1" else "1 object"]
    lines += ["dark"] if style.dark else []
    for line, text in enumerate([*lines, f"flow to {flow_limit:g} px/s"]):
        write(image, text, (x, y + 32 + 18 * line), colour=MUTED)


def save_small(image: Image, path: Path, *, most_kb: float) -> int:
    """Save a JPEG below so many kB, full colour resolution kept for the thin lines of events; its quality."""
    bgr = cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    sampling = [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444, cv2.IMWRITE_JPEG_OPTIMIZE, 1]
    for quality in range(95, 20, -1):
        _, written = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, quality, *sampling])
        if len(written) < most_kb * 1000:
            break
    with new_file(path) as file:
        file.write_bytes(written.tobytes())
    return quality


def main() -> None:
    """Choose, draw, save."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, default=Path("docs/simulated_sets.jpg"))
    parser.add_argument("--most", type=float, default=400, help="kB")
    options = parser.parse_args()
    try:
        recordings = chosen(options.folder)
        image = sheet({number: middle(one) for number, one in recordings.items()})
    except EvimoError as error:
        raise SystemExit(f"error: {error}") from error
    quality = save_small(image, options.out, most_kb=options.most)
    print(
        f"{options.out}: {image.shape[1]}x{image.shape[0]} px, {options.out.stat().st_size / 1e3:.0f} kB, q {quality}"
    )
    for number, one in recordings.items():
        print(f"  set {number}: {one.path.name}, slice {len(one) // 2}")


if __name__ == "__main__":
    main()
