"""How the camera and the movers of a scene move: drawn at random, by what carries them."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evimo.scene.drawing.carriers import Thing
from evimo.scene.drawing.gestures import Following, Toss, level, pendulum, trembling, upright
from evimo.scene.motion import Curve, Motion, Pauses, Rest, Throw, Wander, wander

F8 = NDArray[np.float64]

STATIC_CAMERA, PAUSED_CAMERA, RESTING_MOVER, STILL_MOVER = 0.06, 0.1, 0.2, 0.04
CAMERA_TREMOR, HAND_TREMOR = 0.4, 0.8  # shares
THROWN = 0.25  # of what nothing carries
FOREVER = 1e4
SPINS, HAND_SPINS = (0.2, 0.7, 2.2), (0.1, 0.4, 1.0)  # rad/s, rms
LONG_S = 2.0  # from here on a scene is held together, or what moves in it would be gone for most of the time
REACH, TURN = 0.2, 0.15  # m and rad: root mean square of excursions in such a scene
PAUSE_EVERY_S = 5.0  # in a long scene, of what pauses
SUDDEN_S = (0.005, 0.1)  # to a stop
KEPT_UP = (0.6, 1.1)  # how much of a mover's way a camera that follows it makes up for


@dataclass(frozen=True, slots=True)
class Pace:
    """Root mean square speeds: camera m/s, camera rad/s, movers m/s."""

    camera: float
    turning: float
    mover: float


def camera_motion(rng: np.random.Generator, pose: tuple[F8, F8], pace: Pace, seconds: float) -> Motion:
    """Hand-held: it sways and turns, often trembles, sometimes pauses, or stands still for all of a short scene."""
    zero_s, long = float(rng.uniform(0, seconds)), seconds >= LONG_S
    moves = wander(rng, pace.camera, _band((0.2, 2.5), pace.camera, REACH, long=long), zero_s=zero_s)
    turns = wander(rng, pace.turning, _band((0.3, 3.0), pace.turning, TURN, long=long), zero_s=zero_s)
    if rng.random() < CAMERA_TREMOR:
        moves = trembling(rng, moves, rng.uniform(0.01, 0.08))
        turns = trembling(rng, turns, rng.uniform(0.01, 0.12))
    rest = None
    if (chance := rng.random()) < STATIC_CAMERA and not long:
        rest = Rest(-FOREVER, FOREVER, 0.1)
    elif chance < STATIC_CAMERA + PAUSED_CAMERA:
        rest = _pauses(rng, seconds)
    return Motion(*pose, (moves,), turns, rest)


def following(rng: np.random.Generator, camera: Motion, movers: list[Motion]) -> Motion:
    """The camera's motion if it follows a mover, turning after it or going along: what stands still flies by.

    Nobody follows what is thrown out of reach.
    """
    within_reach = [mover for mover in movers if not isinstance(mover.moves[0], Throw)]
    if not within_reach:
        return camera
    mover, share = within_reach[rng.integers(len(within_reach))], float(rng.uniform(*KEPT_UP))
    (moves,), turns = camera.moves, camera.turns
    assert turns is not None
    if rng.random() < 0.5:
        moves = Following(moves, mover, share * np.eye(3))
    else:
        distance = (mover.position - camera.position) @ camera.rotation[:, 2]
        aside = np.array(
            [[0.0, -1, 0], [1, 0, 0], [0, 0, 0]]
        )  # right: about the axis that points down; down: to the left
        turns = Following(turns, mover, share / distance * aside @ camera.rotation.T)
    return Motion(camera.position, camera.rotation, (moves,), turns)


def mover_motion(rng: np.random.Generator, thing: Thing, speed: float, seconds: float) -> Motion:
    """As what carries it moves it, about its place at some time; `speed` in m/s, rms. It may rest for a while."""
    zero_s = float(rng.uniform(0, seconds))
    moves, turns = _CARRIED[thing.how](rng, thing, speed, zero_s, seconds >= LONG_S)
    rest = None
    if (chance := rng.random()) < STILL_MOVER and seconds < LONG_S:
        rest = Rest(-FOREVER, FOREVER, 0.1)
    elif chance < STILL_MOVER + RESTING_MOVER:
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
