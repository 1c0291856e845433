"""How the camera and the movers of a scene move: drawn at random, by what carries them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evimo.scene.drawing.carriers import Thing
from evimo.scene.drawing.gestures import Following, Toss, level, pendulum, trembling, upright
from evimo.scene.motion import Curve, Motion, Pauses, Rest, Throw, Wander, cross_matrix, wander

F8 = NDArray[np.float64]

STATIC_CAMERA, PAUSED_CAMERA, RESTING_MOVER, STILL_MOVER = 0.06, 0.1, 0.2, 0.04
CAMERA_TREMOR, HAND_TREMOR = 0.4, 0.8  # shares
THROWN = 0.25  # of what nothing carries
SPINS, HAND_SPINS = (0.2, 0.7, 2.2), (0.1, 0.4, 1.0)  # rad/s, rms
LONG_S = 2.0  # from here on a scene is held together, or what moves in it would be gone for most of the time
REACH, TURN = 0.2, 0.15  # m and rad: root mean square of excursions in such a scene
PAUSE_EVERY_S = 5.0  # in a long scene, of what pauses
SUDDEN_S = (0.005, 0.1)  # to a stop
FOLLOWED, CALM = 0.5, 0.4  # share of cameras that follow a mover, if they can; how much of their own motion they keep
KEPT_UP = (0.6, 1.0)  # how much of a mover's way they make up for

Curves = tuple[Curve, Curve]


@dataclass(frozen=True, slots=True)
class Pace:
    """Root mean square speeds: camera m/s, camera rad/s, movers m/s."""

    camera: float
    turning: float
    mover: float


def camera_motion(
    rng: np.random.Generator,
    pose: tuple[F8, F8],
    pace: Pace,
    seconds: float,
    *,
    movers: Sequence[Motion] = (),
    followed: float = FOLLOWED,
) -> Motion:
    """Hand-held: it sways and turns, often trembles; it follows a mover, or sometimes pauses or stands still.

    Nobody follows what is thrown away or stands still. Who follows sways less, and does not pause.
    followed: chance that it follows a mover, if there is one that can be followed.
    """
    leaders = [mover for mover in movers if mover.moves and not is_thrown_away(mover)]
    follows = bool(leaders) and rng.random() < followed
    calm = CALM if follows else 1.0
    zero_s, long = float(rng.uniform(0, seconds)), seconds >= LONG_S
    sway, turning = calm * pace.camera, calm * pace.turning
    moves = wander(rng, sway, _band((0.2, 2.5), sway, REACH, long=long), zero_s=zero_s)
    turns = wander(rng, turning, _band((0.3, 3.0), turning, TURN, long=long), zero_s=zero_s)
    if rng.random() < CAMERA_TREMOR:
        moves = trembling(rng, moves, rng.uniform(0.01, 0.08))
        turns = trembling(rng, turns, rng.uniform(0.01, 0.12))
    if follows:
        leader = leaders[rng.integers(len(leaders))]
        moves, turns = following(pose, (moves, turns), leader, rng.uniform(*KEPT_UP), pan=rng.random() < 0.5)
        return Motion(*pose, (moves,), turns)
    rest = None
    if (chance := rng.random()) < STATIC_CAMERA and not long:
        return Motion(*pose)
    if chance < STATIC_CAMERA + PAUSED_CAMERA:
        rest = _pauses(rng, seconds)
    return Motion(*pose, (moves,), turns, rest)


def following(camera: tuple[F8, F8], curves: Curves, leader: Motion, share: float, *, pan: bool) -> Curves:
    """A camera's moves and turns with a share of what keeps `leader` in its place: turning after it, or going along.

    camera: mean position (3,) and axes (3, 3) as columns.
    """
    (position, axes), (moves, turns) = camera, curves
    if not pan:
        return Following(moves, leader, share * np.eye(3)), turns
    seen = axes.T @ (leader.position - position)
    return moves, Following(turns, leader, share * cross_matrix(seen) / (seen @ seen) @ axes.T)


def is_thrown_away(motion: Motion) -> bool:
    """Whether nobody catches it again."""
    return any(isinstance(curve, Throw) for curve in motion.moves)


def mover_motion(rng: np.random.Generator, thing: Thing, speed: float, seconds: float) -> Motion:
    """As what carries it moves it, about its place at some time; `speed` in m/s, rms. It may rest for a while."""
    zero_s = float(rng.uniform(0, seconds))
    moves, turns = _CARRIED[thing.how](rng, thing, speed, zero_s, seconds >= LONG_S)
    rest = None
    if (chance := rng.random()) < STILL_MOVER and seconds < LONG_S:
        return Motion(thing.at, np.eye(3))
    if chance < STILL_MOVER + RESTING_MOVER:
        rest = _pauses(rng, seconds)
    return Motion(thing.at, np.eye(3), (moves,), turns, rest)


def _band(band: tuple[float, float], rate: float, reach: float, *, long: bool) -> tuple[float, float]:
    """Hz; in a long scene without the low frequencies at which this rate (rms, per second) goes beyond `reach`."""
    low, high = band
    return (min(max(low, rate / (2 * math.pi * reach)), 0.8 * high), high) if long else band


def _pauses(rng: np.random.Generator, seconds: float) -> Rest | Pauses:
    """Sudden stops: one in a short scene, now and then in a long one."""
    if seconds < LONG_S:
        return _rest(rng, float(rng.uniform(-0.5, 0.8) * seconds))
    rests, now = [], float(rng.uniform(0, PAUSE_EVERY_S))
    while now < seconds:
        rests.append(_rest(rng, now))
        now = rests[-1].stop_s + rests[-1].ramp_s + float(rng.exponential(PAUSE_EVERY_S))
    return Pauses(tuple(rests))


def _rest(rng: np.random.Generator, start_s: float) -> Rest:
    ramp_s = float(rng.uniform(*SUDDEN_S))
    return Rest(start_s, start_s + ramp_s + float(rng.uniform(0.1, 1.0)), ramp_s)


Carried = tuple[Curve, Curve | None]


def _flying(rng: np.random.Generator, thing: Thing, speed: float, zero_s: float, long: bool) -> Carried:
    """It wanders, or is thrown: once in a short scene, to and fro between hands in any."""
    moves: Curve = wander(rng, speed, _band((0.3, 3.0), speed, REACH, long=long), zero_s=zero_s)
    if rng.random() < THROWN:
        sideways, up = rng.normal(size=2) * 0.6 * speed, float(rng.uniform(0.8, 2.5))
        once = rng.random() < 0.6 and not long
        velocity = np.array((*sideways, up))
        moves = Throw(velocity - (0, 0, 0.8), zero_s) if once else Toss(velocity, float(rng.uniform(0.1, 0.4)), zero_s)
    return moves, _spin(rng, SPINS, zero_s)


def _sliding(rng: np.random.Generator, thing: Thing, speed: float, zero_s: float, long: bool) -> Carried:
    """On a floor or a table."""
    moves = wander(rng, speed, _band((0.3, 3.0), speed, REACH, long=long), zero_s=zero_s)
    return level(moves), upright(_spin(rng, SPINS, zero_s))


def _in_hand(rng: np.random.Generator, thing: Thing, speed: float, zero_s: float, long: bool) -> Carried:
    moves = wander(rng, speed, _band((0.3, 2.5), speed, REACH, long=long), zero_s=zero_s)
    turns = _spin(rng, HAND_SPINS, zero_s)
    if rng.random() < HAND_TREMOR:
        moves = trembling(rng, moves, rng.uniform(0.02, 0.1))
        turns = trembling(rng, turns, rng.uniform(0.05, 0.4))
    return moves, turns


def _on_string(rng: np.random.Generator, thing: Thing, speed: float, zero_s: float, long: bool) -> Carried:
    swing = pendulum(rng, thing.string, speed, zero_s=zero_s)
    return swing, swing.turns


def _spin(rng: np.random.Generator, rates: tuple[float, ...], zero_s: float) -> Wander:
    return wander(rng, rng.choice(rates) * math.exp(rng.normal() * 0.4), (0.3, 3.0), zero_s=zero_s)


_CARRIED = {
    "nothing": _flying,
    "floor": _sliding,
    "legs": _sliding,
    "hand": _in_hand,
    "stick": _in_hand,
    "string": _on_string,
}
