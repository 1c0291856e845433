"""What one model scores on one recording, as sums: they add up over recordings, and are kept as JSON."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from evimo.evaluation.ratios import Scores
from evimo.evaluation.report import added_tables, plain, scores_from


class FrameScore(NamedTuple):
    """The mask of one slice with movers. start_us: of the slice. wrong_px: called or moving, but not both."""

    start_us: int
    iou: float
    wrong_px: int


@dataclass(frozen=True, slots=True)
class Tally:
    """Scores of a model, or of all trivial answers, over any number of slices.

    rows:   scores by the row's name.
    curves: scores by the curve's name, and in it by the number of the bin or threshold.
    counts: what was scored, and what was left out.
    frames: of each slice with movers of at least 30 pixels.
    """

    rows: Mapping[str, Scores] = field(default_factory=dict[str, Scores])
    curves: Mapping[str, Scores] = field(default_factory=dict[str, Scores])
    counts: Mapping[str, int] = field(default_factory=dict[str, int])
    frames: Sequence[FrameScore] = ()

    def __add__(self, other: "Tally") -> "Tally":
        """Both as one."""
        names = {**self.counts, **other.counts}
        return Tally(
            rows=added_tables(self.rows, other.rows),
            curves=added_tables(self.curves, other.curves),
            counts={name: self.counts.get(name, 0) + other.counts.get(name, 0) for name in names},
            frames=(*self.frames, *other.frames),
        )

    def as_dict(self) -> dict[str, Any]:
        """For JSON; `tally_from` reads it back."""
        return {
            "rows": {row: plain(scores) for row, scores in self.rows.items()},
            "curves": {curve: plain(scores) for curve, scores in self.curves.items()},
            "counts": dict(self.counts),
            "frames": [list(frame) for frame in self.frames],
        }


def tally_from(saved: Mapping[str, Any]) -> Tally:
    """What `Tally.as_dict` made, read back.

    Raises:
        KeyError, TypeError, ValueError, AttributeError: it is something else.
    """
    return Tally(
        rows={row: scores_from(scores) for row, scores in saved["rows"].items()},
        curves={curve: scores_from(scores) for curve, scores in saved["curves"].items()},
        counts={str(name): int(count) for name, count in saved["counts"].items()},
        frames=[FrameScore(int(start_us), float(iou), int(px)) for start_us, iou, px in saved["frames"]],
    )
