"""Which samples of a body's pose can be believed, and which follow from each other without a gap or a jump."""

import math
from bisect import bisect_left

import numpy as np
from numpy.typing import NDArray

F8 = NDArray[np.float64]
I8 = NDArray[np.int64]

BRIDGED_US = 50_000  # the longest gap that is bridged
FASTEST_MPS, FASTEST_RADPS = 9.0, 2 * math.pi * 6.25  # nothing that a hand moves is faster
BRIEF = 5  # so few samples between two jumps are bad; more are somewhere else
RESTART_US = 1_000_000  # back, at least, where a clock starts again; what is less is disorder
STEADY = 10  # samples that rise to both sides of such a place
FARTHEST_M = 1e9  # of the world's origin; a number beyond is damage
NOT_RIGID = 1e-3  # of a rotation's columns against unit length and right angles


def checked_samples(times_us: I8, poses: F8) -> NDArray[np.bool_]:
    """Which samples (N,) are rigid motions, in order of time, and do not jump there and back.

    Of those out of order as few as possible are bad: one lone stamp, be it early or late, is alone in being so. Where
    the clock starts again, all samples from there on are bad.
    """
    good = _rigid(poses)
    good[restart_of(times_us) :] = False
    good[good] = _rising(times_us[good])
    while True:
        kept = np.flatnonzero(good)
        jumps = _jumps(times_us[kept], poses[kept])
        run = np.cumsum(np.append(0, jumps))[: len(kept)]
        sizes = np.bincount(run, minlength=1)
        # A short run counts as bad where a longer one is beside it, lest all of a short recording be bad.
        longer = np.maximum(np.append(sizes[1:], 0), np.append(0, sizes[:-1]))
        brief = np.flatnonzero((sizes <= BRIEF) & (longer > sizes))
        if not len(brief):
            return good
        good[kept[np.isin(run, brief)]] = False


def pieces_of(times_us: I8, poses: F8, bridged_us: int) -> I8:
    """The number of the piece that each sample belongs to; a long gap or a jump begins a new one."""
    broken = (np.diff(times_us) > bridged_us) | _jumps(times_us, poses)
    return np.cumsum(np.append(0, broken))[: len(times_us)].astype(np.int64)


def restart_of(times_us: I8) -> int:
    """The first of the samples (N,) from which on a clock shows times again that it has shown before; N where none is.

    No restart are parts in another order, whose times do not meet, single stamps, a clock that stood still, rows that
    were shuffled, and a late block after which the clock leaps to where it was.
    """
    for at in (np.flatnonzero(np.diff(times_us) < -RESTART_US) + 1).tolist():
        before, after, rest = times_us[max(at - STEADY, 0) : at], times_us[at : at + STEADY], times_us[at:]
        if len(before) < STEADY or len(after) < STEADY or min(np.diff(before).min(), np.diff(after).min()) < 0:
            continue
        if not after[0] < after[-1] < before[0] or rest.max() <= times_us[:at].min():
            continue
        leaps = (np.diff(rest) > RESTART_US) & (rest[1:] > times_us[at - 1])
        if not leaps.any():
            return at
    return len(times_us)


def _rising(times_us: I8) -> NDArray[np.bool_]:
    """The most of some times (N,) that rise from each to the next; of equal ones the first."""
    kept = np.ones(len(times_us), np.bool_)
    if (np.diff(times_us) > 0).all():
        return kept
    # By length of a rising choice, the earliest time that one ends with, and where; and what comes before each time.
    ends: list[int] = []
    places: list[int] = []
    before: list[int] = []
    for place, time_us in enumerate(times_us.tolist()):
        at = bisect_left(ends, time_us)
        before.append(places[at - 1] if at else -1)
        if at == len(ends):
            ends.append(time_us)
            places.append(place)
        elif time_us < ends[at]:
            ends[at], places[at] = time_us, place
    kept[:] = False
    place = places[-1]
    while place >= 0:
        kept[place] = True
        place = before[place]
    return kept


def _rigid(poses: F8) -> NDArray[np.bool_]:
    """Which matrices (N, 4, 4) are finite, and rotations beside a translation that something can have."""
    finite = (np.abs(poses.reshape(-1, 16)) < FARTHEST_M).all(axis=-1).reshape(-1)
    rotation = np.where(finite[:, None, None], poses[:, :3, :3], 0)
    square = rotation @ np.swapaxes(rotation, 1, 2)
    right = np.abs(square - np.eye(3)).max(axis=(1, 2), initial=0) < NOT_RIGID
    return finite & right & (np.linalg.det(rotation) > 0)


def _jumps(times_us: I8, poses: F8) -> NDArray[np.bool_]:
    """Between which samples and their next ones a body would move faster than anything does: (N - 1,)."""
    step_s = np.diff(times_us) * 1e-6
    offset = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    trace = np.einsum("nij,nij->n", poses[1:, :3, :3], poses[:-1, :3, :3]) if len(poses) > 1 else np.zeros(0)
    angle = np.arccos(np.clip((trace - 1) / 2, -1, 1))
    return (offset > FASTEST_MPS * step_s) | (angle > FASTEST_RADPS * step_s)
