"""What a gyroscope beside the sensor says: angular velocity over time, in the events' clock."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

F8 = NDArray[np.float64]

LONGEST_GAP_US = 20_000  # between samples: what happened in a longer one is unknown


@dataclass(frozen=True, eq=False)
class Gyroscope:
    """N samples of a gyroscope, at least two, at rising times.

    t_us:           (N,) int64, µs in the events' clock.
    rate:           (N, 3) angular velocity, rad/s.
    in_camera_axes: whether its axes are the camera's (x right, y down, z forward); else they are its own.
    source:         where in the recording it was found, for a reader.
    """

    t_us: NDArray[np.int64]
    rate: F8
    in_camera_axes: bool
    source: str

    def __len__(self) -> int:
        return len(self.t_us)

    @property
    def rate_hz(self) -> float:
        """Samples per second, by the median interval."""
        return 1e6 / float(np.median(np.diff(self.t_us)))

    def mean_rate(self, start_us: int, stop_us: int) -> F8 | None:
        """Mean angular velocity (3,) rad/s over start_us <= t < stop_us; None where samples do not cover it."""
        rate, valid = self.mean_rates(np.array([start_us]), np.array([stop_us]))
        return rate[0] if valid[0] else None

    def mean_rates(self, start_us: NDArray[np.int64], stop_us: NDArray[np.int64]) -> tuple[F8, NDArray[np.bool_]]:
        """Mean angular velocities (M, 3) over M intervals, and whether samples cover each without a longer gap.

        The velocity is integrated exactly as linear between samples. Intervals may begin and end between samples, but
        not before the first or after the last.
        """
        t, (turned, gaps) = self.t_us, self._integral
        first = np.clip(np.searchsorted(t, start_us, "right") - 1, 0, len(t) - 2)
        last = np.clip(np.searchsorted(t, stop_us, "left"), 1, len(t) - 1)
        valid = (start_us >= t[0]) & (stop_us <= t[-1]) & (stop_us > start_us) & (gaps[last] == gaps[first])
        angle = self._turned_at(stop_us, last - 1, turned) - self._turned_at(start_us, first, turned)
        return angle / np.maximum(stop_us - start_us, 1)[:, None], valid

    def _turned_at(self, time_us: NDArray[np.int64], sample: NDArray[np.int64], turned: F8) -> F8:
        """Integral (M, 3) from the first sample to times, each in the interval that follows its sample."""
        since = (time_us - self.t_us[sample])[:, None].astype(np.float64)
        slope = (self.rate[sample + 1] - self.rate[sample]) / (self.t_us[sample + 1] - self.t_us[sample])[:, None]
        return turned[sample] + since * (self.rate[sample] + 0.5 * slope * since)

    @cached_property
    def _integral(self) -> tuple[F8, NDArray[np.int64]]:
        """At each sample: the integral from the first one (N, 3), rad/s times µs, and how many gaps lie between."""
        steps = np.diff(self.t_us)
        areas = 0.5 * (self.rate[1:] + self.rate[:-1]) * steps[:, None]
        turned = np.concatenate((np.zeros((1, 3)), np.cumsum(areas, axis=0)))
        return turned, np.concatenate(([0], np.cumsum(steps > LONGEST_GAP_US)))


def gyroscope_of(
    t_us: NDArray[np.int64], rate: NDArray[np.floating], *, in_camera_axes: bool, source: str
) -> Gyroscope | None:
    """The gyroscope of samples as they are stored: sorted, one for each time, finite; None where fewer than two are."""
    finite = np.isfinite(rate).all(axis=1)
    times, index = np.unique(t_us[finite], return_index=True)
    if len(times) < 2:
        return None
    return Gyroscope(times.astype(np.int64), rate[finite][index].astype(np.float64), in_camera_axes, source)
