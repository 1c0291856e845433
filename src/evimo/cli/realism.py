"""`evimo realism`: do simulated events look like real ones?"""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evimo.cli.progress import progress
from evimo.cli.reading import AS_TOLD, Reading
from evimo.cli.streams import console
from evimo.errors import BadInput
from evimo.evaluation.event_statistics import (
    EventStatistics,
    count_shares,
    event_statistics,
    shares_up_to,
    whole_slices,
)
from evimo.evaluation.realism import Realism, Verdict, interval_grid_ms
from evimo.evaluation.realism_tables import as_markdown, as_rich
from evimo.formats import EventFile, open_events
from evimo.recordings.finding import recordings_in
from evimo.viewing.charts import Axis, Curve, RatioRow, draw_curves, draw_ratios
from evimo.viewing.colours import BACKDROP, NEGATIVE, OBJECTS, POSITIVE, RGB, Image
from evimo.viewing.layout import Box
from evimo.viewing.picture import picture_file
from evimo.writing import make_folder, save_files

F8 = NDArray[np.float64]

WIDTH = 150
PANEL = (470, 760)
REAL, SIMULATED = NEGATIVE, POSITIVE
REAL_COLOURS: tuple[RGB, ...] = (REAL, OBJECTS[3], OBJECTS[0], OBJECTS[5])
MOST_NAMED = 4


def realism(*real: Path, simulated: Path, out: Path | None = None, reading: Reading = AS_TOLD) -> None:
    """Compare the statistics of simulated events with those of real recordings.

    Intervals between the events of one pixel, ON fraction, events per active pixel, isolated events, counts per pixel
    and per slice of 25 ms: as a table, with those that leave the range of the real recordings marked.

    Args:
        real: event recordings, at best of the simulated sensor and of scenes of the simulated kind.
        simulated: a folder of recordings from evimo simulate, or one of them.
        out: where report.md, realism.json and realism.png go.
        reading: what the files of the real recordings do not tell.
    """
    if not real:
        raise BadInput("no real recording given", fix="evimo realism REAL --simulated DIR")
    files = [reading.opened(path) for path in real]
    made = [open_events(folder) for folder in recordings_in([simulated])]
    if out is not None:
        make_folder(out)
    with progress(sum(whole_slices(each) for each in (*files, *made))) as advance:
        compared = Realism(_statistics(files, advance), _statistics(made, advance))
    console(WIDTH).print(as_rich(compared))  # narrower, it folds into letters
    if out is not None:
        picture = picture_file(drawn(compared), out / "realism.png")
        contents = {"report.md": as_markdown(compared), "realism.json": compared.as_json(), "realism.png": picture}
        save_files(out, contents)
        print(f"saved in {out}: report.md, realism.json, realism.png")


def _statistics(files: Sequence[EventFile], advance: Callable[[], None]) -> list[EventStatistics]:
    return [event_statistics(each, advance=advance) for each in files]


def drawn(compared: Realism) -> Image:
    """Four panels: intervals, counts per pixel, events per slice, and all judged statistics over the real range."""
    height, width = PANEL
    gap = 12
    image = np.full((2 * height + 3 * gap, 2 * width + 3 * gap, 3), BACKDROP, np.uint8)
    left, right = (Box(gap + column * (width + gap), gap, width, height) for column in (0, 1))
    below, corner = (box._replace(y=2 * gap + height) for box in (left, right))
    grid, shares = interval_grid_ms(), (0.0, 0.25, 0.5, 0.75, 1.0)
    across = Axis("ms between an event and the next of its pixel", 0.05, 1000, (0.1, 1, 10, 100, 1000), log=True)
    curves = _curves(compared, grid, lambda each: shares_up_to(each, grid))
    draw_curves(image, left, "Intervals", axes=(across, Axis("", 0, 1, shares)), curves=curves)
    numbers = np.arange(1, 13)
    across = Axis("events of a pixel in a slice: share of active pixels", 1, 12, (1, 2, 3, 4, 6, 8, 10, 12))
    curves = _curves(compared, numbers.astype(float), lambda each: count_shares(each)[:12])
    logarithmic = Axis("", 1e-4, 1, (1e-4, 1e-3, 1e-2, 0.1, 1), log=True)
    draw_curves(image, right, "Counts", axes=(across, logarithmic), curves=curves)
    sizes = np.exp2(np.arange(4, 19, 0.25))
    across = Axis("events in a slice: share of slices with fewer", 16, 2e5, (100, 1e3, 1e4, 1e5), log=True)
    curves = _curves(compared, sizes, lambda each: np.searchsorted(np.sort(each.per_slice), sizes) / each.slices)
    draw_curves(image, below, "Slices", axes=(across, Axis("", 0, 1, shares)), curves=curves)
    rows = [row for verdict in compared.verdicts if (row := _row(compared, verdict)) is not None]
    draw_ratios(image, corner, "Statistics: real range, simulated", rows=rows, colours=(REAL, SIMULATED))
    return image


def _curves(compared: Realism, x: F8, shares: Callable[[EventStatistics], F8]) -> list[Curve]:
    """The middle and the spread of the simulated recordings, then each real one, or theirs if there are many."""
    curves = [_bundle("simulated", compared.simulated, x, shares, SIMULATED)]
    if len(compared.real) > MOST_NAMED:
        return [*curves, _bundle("real", compared.real, x, shares, REAL)]
    return [
        *curves,
        *(
            Curve(_short(each.name), x, shares(each), colour)
            for each, colour in zip(compared.real, REAL_COLOURS, strict=False)
        ),
    ]


def _bundle(
    name: str, those: Sequence[EventStatistics], x: F8, shares: Callable[[EventStatistics], F8], colour: RGB
) -> Curve:
    low, middle, high = np.percentile([shares(each) for each in those], (10, 50, 90), axis=0)
    return Curve(f"{name} (p10, median, p90)", x, middle, colour, low, high)


def _row(compared: Realism, verdict: Verdict) -> RatioRow | None:
    """A judged statistic whose real values are positive."""
    measure, low, high = verdict.measure, verdict.low, verdict.high
    if not measure.judged or low is None or high is None or low <= 0:
        return None
    dots = [value for each in compared.simulated if (value := each.values[measure.name]) is not None]
    return RatioRow(
        measure.header.replace("≥", ">= "),
        low,
        high,
        dots,
        allowed=measure.widened(low, high),
        median=verdict.median,
        bad=verdict.inside is False,
    )


def _short(name: str, *, longest: int = 18) -> str:
    """OpenCV writes ASCII only."""
    plain = name.encode("ascii", "replace").decode()
    return plain if len(plain) <= longest else f"{plain[: longest - 2]}.."
