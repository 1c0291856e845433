"""The tables of a run: `egomotion.csv`, one row per slice, and `objects.csv`, one row per object and slice."""

import csv
from contextlib import ExitStack
from pathlib import Path

from evimo.recordings.estimate import Estimate

EGO_COLUMNS = ("t_us", "rel_vx", "rel_vy", "rel_vz", "wx", "wy", "wz")
OBJECT_COLUMNS = ("t_us", "object", "x0", "y0", "x1", "y1", "area_px", "centroid_x", "centroid_y") + (
    "rel_distance",
    "rel_vx",
    "rel_vy",
    "rel_vz",
)


class Tables:
    """The tables of a run, written as it goes.

    t_us is the slice's centre in the recording's own time. `rel_` velocities are in mean depths per second, wx, wy, wz
    in rad/s, all in camera axes, and those of a slice without events are empty. Boxes (last column and row included)
    and centroids are in sensor px.
    """

    def __init__(self, egomotion: Path, objects: Path | None) -> None:
        """Start them; `objects` is None for a model that finds none."""
        self._files = [path.open("w", newline="", encoding="utf-8") for path in (egomotion, objects) if path]
        self._ego, *objects_table = (csv.writer(file, lineterminator="\n") for file in self._files)
        self._ego.writerow(EGO_COLUMNS)
        self._objects = objects_table[0] if objects_table else None
        if self._objects:
            self._objects.writerow(OBJECT_COLUMNS)

    def write(self, estimate: Estimate) -> None:
        """Add one slice."""
        self._ego.writerow((estimate.t_us, *(_rounded(*estimate.ego) if estimate.has_events else [""] * 6)))
        for one in estimate.objects or ():
            numbers = _rounded(*one.centroid, one.rel_distance, *one.rel_velocity)
            assert self._objects, "a table of objects where there are any"
            self._objects.writerow((estimate.t_us, one.id, *one.box, one.area_px, *numbers))

    def close(self) -> None:
        """Finish the files."""
        with ExitStack() as both:  # the second one even where the first fails
            for file in self._files:
                both.callback(file.close)


def _rounded(*numbers: float) -> list[str]:
    """Six digits: more than any estimate is worth."""
    return [f"{number:.6g}" for number in numbers]
