"""The calibration, and what events do at an outline, that explain profiles of events around outlines best."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evimo.calibrating.profiles import STEPS, Profiles

F8 = NDArray[np.float64]

USUAL = np.array((0.003,) * 3 + (0.02,) * 3 + (50_000.0,)) / STEPS  # how wrong a calibration is, in steps
HELD = 1e-6  # of that: in rounds that leave the place as it is
SLOW_PX_S = 8.0  # below, it is not clear which way an outline moves
USUAL_SHIFT_PX = 0.3  # of events from an outline
MOST_SHIFT_PX = 0.6  # more is no shift but another edge, of a texture
USUAL_LAG = 10.0  # STEPS of the clock, between ON and OFF
SCATTER_PX = 0.7  # of an event about its outline
ITERATIONS, OVER, ENOUGH = 80, 1.5, 1e-3  # steps are made longer by half: expectation maximisation is slow
FEWEST = 0.3  # events in a profile
SIDE_PX = 4.0  # wide, from where an outline ends, events tell how many there are away from it
STRAY = 0.01  # events per px there, at least
MOST = 5.0  # weight of a point, in events: clear outlines count more, and no flickering pixel outvotes many


@dataclass(frozen=True, slots=True)
class Shifts:
    """Where events lie beside an outline. All four are found with the calibration, which they would spoil.

    room, body:  px towards what is behind: texture that is drawn in, scans that stand out, as discs do.
    behind:      px that events stay behind an outline that moves, however fast: light must change by a threshold.
    dark:        px towards its darker side: half of the change in ln(light) through a blurred step comes there.
    on_lag_us:   how much later ON events are than the mean of both; pixels are slower in the dark.
    """

    room: float
    body: float
    behind: float
    dark: float
    on_lag_us: float

    @property
    def at_limit(self) -> bool:
        """Whether some shift is as large as is allowed: then it is texture that outlines were laid on."""
        return max(map(abs, (self.room, self.body, self.behind, self.dark))) >= MOST_SHIFT_PX - 1e-9


@dataclass(frozen=True, slots=True)
class Round:
    """One round of alignment.

    width_px: standard deviation of what counts as on the outline.
    stretch:  of the profiles: how much further and coarser than usual.
    place:    whether the camera's translation is fitted too. shifts: whether `Shifts` are.
    """

    width_px: float
    stretch: float
    place: bool
    shifts: bool


def fit_outlines(found: Profiles, how: Round, apart: F8) -> tuple[F8, Shifts]:
    """The step of a calibration (7,), in m, rad, µs, that brings outlines to where events are, and their shifts.

    Events of a profile belong to its outline or to what is beside it, by expectation and maximisation; those that do
    say where the outline is, and all outlines together are laid there by least squares.

    Args:
        found: profiles at some calibration.
        how: this round.
        apart: how far that calibration has come from the first one (7,); it is held near that one by `USUAL`.
    """
    rows, events = _rows(found)
    usual = USUAL * np.where(np.arange(len(USUAL)) < 3, 1.0 if how.place else HELD, 1.0)
    shifts = np.array((*(USUAL_SHIFT_PX,) * 4, USUAL_LAG)) * (1.0 if how.shifts else HELD)
    trust = np.concatenate((usual, shifts)) ** -2
    pull = np.concatenate((-apart / STEPS, np.zeros(len(shifts))))
    pull[:3] *= how.place  # where the place is held, it is held where it is now
    x = np.zeros(rows.shape[1])
    for _ in range(ITERATIONS):
        at = rows @ x
        aim, weight = _assigned(events, found.at, at, how.width_px)
        weighted = rows * (weight / SCATTER_PX**2)[:, None]
        step = np.linalg.solve(weighted.T @ rows + np.diag(trust), weighted.T @ aim + trust * pull) - x
        x = x + OVER * step
        x[7:11] = np.clip(x[7:11], -MOST_SHIFT_PX, MOST_SHIFT_PX)
        if np.abs(step).max() < ENOUGH:
            break
    room, body, behind, dark, lag = x[7:].tolist()
    return STEPS * x[:7], Shifts(room, body, behind, dark, lag * float(STEPS[6]))


def _rows(found: Profiles) -> tuple[F8, F8]:
    """How each profile of one polarity would shift with each unknown, px (2 N, 12), and its events (2 N, S)."""
    way = np.tanh(found.speed / SLOW_PX_S)[:, None]
    of_room = (found.body == 0)[:, None].astype(np.float64)
    clock = found.slopes[:, 6:]
    rows = [
        np.concatenate((found.slopes, of_room, 1 - of_room, -way, polarity * way, polarity * clock), axis=1)
        for polarity in (-1, 1)
    ]
    events = np.concatenate((found.events[:, 0], found.events[:, 1]))
    seen = events.sum(axis=1) > FEWEST
    return np.concatenate(rows)[seen], events[seen]


def _assigned(events: F8, at: F8, outline: F8, width_px: float) -> tuple[F8, F8]:
    """Where the events of each profile put its outline, px (N,), and their weight (N,), given where it is now."""
    apart = at - outline[:, None]
    kernel = np.exp(-0.5 * (apart / width_px) ** 2)
    beside = (np.abs(apart) > 2 * width_px) & (np.abs(apart) < 2 * width_px + SIDE_PX)
    stray = [
        (events * side).sum(axis=1) / np.maximum(side.sum(axis=1), 1)
        for side in (beside & (apart < 0), beside & (apart > 0))
    ]
    stray = np.where(apart < 0, stray[0][:, None], stray[1][:, None]) + STRAY
    on_it = kernel * ((events * kernel).sum(axis=1) / np.maximum(kernel.sum(axis=1), 1e-9))[:, None]
    weights = events * kernel * on_it / (on_it + stray)
    weight = weights.sum(axis=1)
    mean = (weights * apart).sum(axis=1) / np.maximum(weight, 1e-9)
    inside = np.abs(outline) < at[-1] - 1
    return outline + mean, np.minimum(weight, MOST) * inside
