"""Do simulated events look like real ones? Statistics of both side by side, and which leave the range of the real."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadInput
from evimo.evaluation.event_statistics import (
    ALONE_US,
    HOT_EVENTS,
    HOT_HZ,
    HOT_TIMES,
    INTERVAL_PERCENTILES,
    EventStatistics,
    shares_up_to,
)
from evimo.events.slices import SLICE_US
from evimo.recordings.facts import own_version

FORMAT = 1
"""Of realism.json; grows when the meaning of a number changes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Measure:
    """One statistic; the range of the real recordings is widened by a factor or by a margin before it judges.

    Without either it is shown only: it depends on the scene and on how the camera moves.
    """

    name: str
    header: str
    meaning: str
    unit: str = ""
    digits: int = 2
    factor: float | None = None
    margin: float | None = None

    @property
    def judged(self) -> bool:
        """Whether leaving the range counts."""
        return self.factor is not None or self.margin is not None

    def widened(self, low: float, high: float) -> tuple[float, float]:
        """The range that simulated values must keep."""
        factor, margin = self.factor or 1.0, self.margin or 0.0
        return low / factor - margin, high * factor + margin

    @property
    def tolerance(self) -> str:
        """How far beyond the range is allowed, in words."""
        if self.factor is not None:
            return f"×{self.factor:g}"
        return f"±{self.margin:g}" if self.margin is not None else "–"


def _interval(percent: float) -> Measure:
    return Measure(
        name=f"interval_{percent:g}",
        header=f"interval p{percent:g}",
        meaning=f"time between an event and the next of its pixel: {percent:g} % are shorter, of those up to 25 ms",
        unit="ms",
        factor=1.5,
    )


# Why so far: four real DAVIS clips, cameras at rest and moving, differ in their intervals by 1.2 to 2.1 between them,
# and have 1.61 to 1.89 events per active pixel, 0.47 to 0.62 with one and 0.03 to 0.09 with four. ON fractions (0.39 to
# 0.52) and polarity changes (0.25 to 0.81) are also of what is seen. Noise goes with the light: tenfold between two
# cameras of one kind, so that a factor of two beyond is little.
MEASURES: tuple[Measure, ...] = (
    *(_interval(percent) for percent in INTERVAL_PERCENTILES),
    Measure(name="longer", header="intervals >25 ms", meaning="share of all intervals"),
    Measure(
        name="changes", header="polarity changes", meaning="share of intervals after which polarity differs", margin=0.1
    ),
    Measure(name="on", header="ON fraction", meaning="share of events that are brighter", margin=0.05),
    Measure(
        name="per_active",
        header="events per active pixel",
        meaning="in a slice of 25 ms, at pixels with any",
        factor=1.15,
    ),
    Measure(name="one", header="active with 1 event", meaning="share of active pixels with a single event", margin=0.1),
    Measure(
        name="four", header="active with ≥4", meaning="share of active pixels with four events or more", margin=0.1
    ),
    Measure(
        name="isolated",
        header="isolated events",
        meaning=f"per pixel, without another within {ALONE_US // 1000} ms in its 3x3 pixels",
        unit="Hz",
        digits=3,
        factor=2.0,
    ),
    Measure(
        name="quiet",
        header="isolated, quiet places",
        meaning="the same per pixel and second with no other event so near",
        unit="Hz",
        digits=3,
        factor=2.0,
    ),
    Measure(
        name="hot",
        header="hot pixels",
        meaning=f"at least {HOT_HZ} Hz and {HOT_EVENTS} events, over {HOT_TIMES} times each neighbour; left out",
        unit="ppm",
        digits=0,
    ),
    Measure(name="rate", header="event rate", meaning="per pixel", unit="Hz"),
    Measure(name="active", header="active pixels", meaning="share of pixels with an event in a slice", digits=3),
    *(
        Measure(
            name=f"slice_{percent}",
            header=f"slice p{percent}",
            meaning=f"events of a slice per pixel of the sensor: {percent} % of slices have fewer",
            digits=3,
        )
        for percent in (10, 50, 90)
    ),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """One measure of real and simulated recordings; None where no recording gave a value.

    real: of each recording. low, high: the range of the real. p10, median, p90: over the simulated recordings.
    inside: whether the median keeps the widened range; None where nothing is judged. recordings_inside: share of them.
    off: the median over, or minus, the nearest end of the real range; 1 or 0 within it.
    """

    measure: Measure
    real: tuple[float | None, ...]
    low: float | None = None
    high: float | None = None
    p10: float | None = None
    median: float | None = None
    p90: float | None = None
    inside: bool | None = None
    recordings_inside: float | None = None
    off: float | None = None


@dataclass(frozen=True, slots=True)
class Realism:
    """Statistics of real and of simulated recordings.

    Raises:
        BadInput: there are none of one kind.
    """

    real: Sequence[EventStatistics]
    simulated: Sequence[EventStatistics]

    def __post_init__(self) -> None:
        for kind, recordings in (("real", self.real), ("simulated", self.simulated)):
            if not recordings:
                raise BadInput(f"no {kind} recording to compare", fix="evimo realism REAL --simulated DIR")

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """One for each measure."""
        return tuple(self.verdict(measure) for measure in MEASURES)

    @property
    def outside(self) -> tuple[Verdict, ...]:
        """The measures that give the simulation away."""
        return tuple(verdict for verdict in self.verdicts if verdict.inside is False)

    def verdict(self, measure: Measure) -> Verdict:
        """Real and simulated values of one measure."""
        real = tuple(each.values[measure.name] for each in self.real)
        known = [value for value in real if value is not None]
        made = np.array([value for each in self.simulated if (value := each.values[measure.name]) is not None])
        if not known or not len(made):
            return Verdict(measure=measure, real=real)
        low, high = min(known), max(known)
        least, most = measure.widened(low, high)
        p10, median, p90 = np.percentile(made, (10, 50, 90)).tolist()
        return Verdict(
            measure=measure,
            real=real,
            low=low,
            high=high,
            p10=p10,
            median=median,
            p90=p90,
            inside=least <= median <= most if measure.judged else None,
            recordings_inside=float(((made >= least) & (made <= most)).mean()) if measure.judged else None,
            off=_off(measure, median, low, high),
        )

    def as_dict(self) -> dict[str, Any]:
        """For JSON: the verdicts, then everything about each recording."""
        return {
            "format": FORMAT,
            "evimo": own_version(),
            "slice_ms": SLICE_US // 1000,
            "verdicts": {
                each.measure.name: {**asdict(each), "measure": asdict(each.measure)} for each in self.verdicts
            },
            "outside": [each.measure.name for each in self.outside],
            "real": [_recording(each) for each in self.real],
            "simulated": [_recording(each) for each in self.simulated],
        }

    def as_json(self) -> str:
        """All of it."""
        return json.dumps(self.as_dict(), indent=1, ensure_ascii=False) + "\n"


def interval_grid_ms() -> NDArray[np.float64]:
    """Lengths at which intervals are summed up: four per octave, 0.03 ms to 4 s."""
    return np.exp2(np.arange(-5, 12.25, 0.25))


def _off(measure: Measure, median: float, low: float, high: float) -> float | None:
    nearest = min(max(median, low), high)
    if measure.factor is None:
        return median - nearest
    if median == nearest:
        return 1.0
    return median / nearest if nearest > 0 else None


def _recording(statistics: EventStatistics) -> dict[str, Any]:
    grid = interval_grid_ms()
    return {
        "name": statistics.name,
        "sensor": statistics.sensor,
        "slices": statistics.slices,
        "events": statistics.events,
        "hot_pixels": statistics.hot_pixels,
        "values": dict(statistics.values),
        "interval_ms": grid.tolist(),
        "share_of_intervals_up_to": shares_up_to(statistics, grid).tolist(),
        "pixels_in_slices_by_count": statistics.counts.tolist(),
        "events_per_slice": statistics.per_slice.tolist(),
    }
