"""Draw what a four-parameter method is made for: one plane, nothing that moves, no turning out of the picture plane."""

import math
from dataclasses import replace

import numpy as np

from evimo.scene.bodies import BOX, Scene
from evimo.scene.drawing.furniture import Room
from evimo.scene.drawing.gestures import upright
from evimo.scene.drawing.moving import LONG_S, Pace, camera_motion
from evimo.scene.drawing.paint import Paint
from evimo.scene.drawing.rooms import WALL_PERIOD
from evimo.scene.drawing.scenes import PACES, SetStyle
from evimo.scene.motion import Motion, Wander, looking_at
from evimo.scene.textures.bank import TextureBank

DISTANCE = (1.0, 1.9)  # m, from the wall, as in the replica's rooms with walls
POSTERS = (8, 16)  # what four parameters are fitted to: a bare wall shows nothing
THICK = 0.002  # m, of half a poster: no depth to speak of
AROUND = (1.2, 0.8)  # m, to each side of the middle and above and below it, where posters hang
CONTRAST, PERIOD, FAINT = (1.2, 2.5), (0.4, 3.0), 0.15
PLAIN_WALL, PLAIN_POSTER = 0.3, 0.2
JITTER = 0.3  # spread of the logarithm of speeds


def draw_planar_scene(rng: np.random.Generator, style: SetStyle, bank: TextureBank, *, seconds: float) -> Scene:
    """One wall with posters, seen from straight in front, by a camera that neither rolls nor pitches.

    These are the sequences of the paper's comparison with a four-parameter method (its Table III): without independent
    objects, without motion of the camera out of its picture plane but for translation, and a planar background.
    """
    half = np.array([rng.uniform(4, 6), rng.uniform(3, 5), rng.uniform(2.6, 3.4)]) / 2
    room = Room(rng, Paint(bank, style.plain, CONTRAST, PERIOD, FAINT), half)
    walls = replace(room.paint, period=WALL_PERIOD).surface(rng, plain=PLAIN_WALL)
    room.add(BOX, (0, 0, half[2]), half, inside=True, surface=walls)
    middle = np.array([room.within(0.2, 0), half[1], half[2] + rng.uniform(-0.2, 0.2)])
    for _ in range(int(rng.integers(*POSTERS))):
        aside, up = rng.uniform(-1, 1, 2) * AROUND
        size = (rng.uniform(0.1, 0.4), THICK, rng.uniform(0.1, 0.35))
        room.add(BOX, middle + (aside, 0, up), size, plain=PLAIN_POSTER)
    position = middle - (0, rng.uniform(*DISTANCE), 0)
    pose, pace = (position, looking_at(position, middle)), _jittered(rng, PACES[style.pace])
    camera = _in_plane(camera_motion(rng, pose, pace, max(seconds, LONG_S)))  # for so long no camera stands still
    light = rng.normal(size=3) + (0, 0, 1.5)
    ambient = float(rng.uniform(0.3, 0.8))
    return Scene((room.body(),), camera, light / np.linalg.norm(light), ambient, bank, room="wall")


def _in_plane(camera: Motion) -> Motion:
    """The same motion without pauses, turning about the optical axis alone, the third of the camera's own axes."""
    assert isinstance(camera.turns, Wander)
    return replace(camera, turns=upright(camera.turns), rest=None)


def _jittered(rng: np.random.Generator, pace: Pace) -> Pace:
    speeds = (pace.camera, pace.turning, pace.mover)
    return Pace(*(speed * math.exp(rng.normal() * JITTER) for speed in speeds))
