"""A tracked body's path, fitted a stretch at a time: hours of motion capture need no more memory than their samples."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from evimo.captures.tracks import MocapTrack
from evimo.geometry.trajectory import Motion, Trajectory, fit_trajectory

I8 = NDArray[np.int64]

STRETCH_US, MARGIN_US = 20_000_000, 1_000_000  # fitted together; and before and after, so that no end is felt within


class BodyPath:
    """Where a body was at any time, and how fast; its samples are fitted where they are asked for."""

    def __init__(self, track: MocapTrack) -> None:
        self._track = track if track.tracked.all() else track.picked(np.flatnonzero(track.tracked))
        self._fitted = lru_cache(maxsize=2)(self._fit)

    def at(self, times_us: I8) -> Motion:
        """Poses and twists at times (M,), as of a `Trajectory`."""
        stretches = times_us // STRETCH_US
        poses, twist = np.tile(np.eye(4), (len(times_us), 1, 1)), np.zeros((len(times_us), 6))
        valid = np.zeros(len(times_us), np.bool_)
        for stretch in np.unique(stretches).tolist():
            mine = stretches == stretch
            motion = self._fitted(stretch).at(times_us[mine])
            poses[mine], twist[mine], valid[mine] = motion.world_from_body, motion.twist, motion.valid
        return Motion(poses, twist, valid)

    def samples_us(self, start_us: int, stop_us: int) -> I8:
        """The times with start <= t < stop at which motion capture saw it."""
        first, last = np.searchsorted(self._track.times_us, (start_us, stop_us))
        return self._track.times_us[first:last]

    def last_seen_us(self, times_us: I8) -> I8:
        """When motion capture saw it last, at or before each time (M,); before the first time it is that one."""
        samples = self._track.times_us
        if not len(samples):
            return np.full(len(times_us), np.iinfo(np.int64).min // 2)
        return samples[np.maximum(np.searchsorted(samples, times_us, side="right") - 1, 0)]

    def _fit(self, stretch: int) -> Trajectory:
        start_us = stretch * STRETCH_US
        borders = (start_us - MARGIN_US, start_us + STRETCH_US + MARGIN_US)
        first, last = np.searchsorted(self._track.times_us, borders)
        samples = self._track.picked(np.arange(first, last))
        return fit_trajectory(samples.times_us, samples.world_from_body)
