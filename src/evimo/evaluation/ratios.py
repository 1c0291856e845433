"""Ratios of sums that add up over slices, recordings and machines."""

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Score:
    """A ratio of two sums and how many samples are in it: frames for a mean over frames, slices for a pooled share."""

    top: float
    bottom: float
    samples: int = 1

    def __add__(self, other: "Score") -> "Score":
        return Score(self.top + other.top, self.bottom + other.bottom, self.samples + other.samples)

    @property
    def value(self) -> float | None:
        """The ratio; None where nothing was scored."""
        return self.top / self.bottom if self.bottom else None


Scores = dict[str, Score]


def added(parts: Iterable[Scores]) -> Scores:
    """Scores of several slices or recordings as one; a name that is missing in one part adds nothing."""
    total: Scores = {}
    for part in parts:
        for name, score in part.items():
            total[name] = total[name] + score if name in total else score
    return total
