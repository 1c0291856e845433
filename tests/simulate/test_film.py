"""Frames come often enough for what moves, however small it is."""

import numpy as np
import pytest

from evimo.geometry.camera import Camera
from evimo.scene.bodies import BOX, ELLIPSOID, Body, Part, Scene, Surface
from evimo.scene.motion import Motion, Throw
from evimo.scene.rays.film import TILE
from evimo.scene.renderer import COARSE, Renderer
from evimo.scene.textures.bank import texture_bank
from evimo.simulate.film import SHORTEST_S, STEP_PX, steps

CAMERA = Camera(fx=100.0, fy=100.0, cx=79.5, cy=59.5, height=120, width=160, distortion=(0.0, 0.0, 0.0, 0.0))
GREY = Surface(0, 1.0, (0.0, 0.0), 0.4, 0.6)
START_S, STOP_S = 0.0, 0.025


def thrown(speed_mps: float, radius: float, *, turning: float = 0.0) -> Scene:
    """A ball crosses the middle of the view, 2 m away, at the middle of the slice; nothing else moves on its own."""
    room = Body((Part(BOX, np.array((3.0, 3.0, 3.0)), np.zeros(3), np.eye(3), GREY, inside=True),))
    moves = Throw(np.array((speed_mps, 0.0, 0.0)), 0.5 * (START_S + STOP_S))
    ball = Part(ELLIPSOID, np.full(3, radius), np.zeros(3), np.eye(3), GREY)
    mover = Body((ball,), Motion(np.array((0.0, 0.0, 2.0)), np.eye(3), (moves,)))

    def turns(time_s):
        return np.outer(time_s, (0, turning, 0)), np.tile((0, turning, 0), (len(time_s), 1))

    bank = texture_bank(7, plain=2, dense=10)
    return Scene((room, mover), Motion(np.zeros(3), np.eye(3), (), turns), np.array((0.0, 0.0, -1.0)), 0.5, bank)


@pytest.mark.parametrize("speed_mps", [5.0, 20.0, 45.0])
def test_a_small_fast_ball_is_never_skipped(speed_mps):
    """In every tile that it crosses, at any time, it moves at most 1.5 px between two casts."""
    time_s, strides = steps(Renderer(thrown(speed_mps, 0.06), CAMERA), START_S, STOP_S)
    px_per_s = speed_mps / 2.0 * CAMERA.fx
    assert 0.06 / 2.0 * CAMERA.fx > COARSE / 2, "the coarse rays can see it"
    assert np.pi * (0.06 / 2.0 * CAMERA.fx) ** 2 < 0.01 * 120 * 160, "the 99th percentile of flow does not know it"
    step_s = time_s[1] - time_s[0]
    assert px_per_s * step_s <= 1.5 + 1e-9 or step_s <= SHORTEST_S
    x = CAMERA.cx + px_per_s * (np.linspace(START_S, STOP_S, 200) - 0.5 * (START_S + STOP_S))
    columns = (x[(x >= 0) & (x < CAMERA.width)] / TILE).astype(int)
    rows = int(CAMERA.cy / TILE)
    assert px_per_s * step_s * strides[rows, columns].max() <= max(1.5, px_per_s * step_s) + 1e-9


def test_what_stands_still_is_cast_less_often():
    time_s, strides = steps(Renderer(thrown(40.0, 0.06), CAMERA), START_S, STOP_S)
    assert strides[0, 0] > strides[int(CAMERA.cy / TILE), int(CAMERA.cx / TILE)]
    assert ((len(time_s) - 1) % strides == 0).all()


def test_a_turning_camera_sets_the_pace():
    """Image speed is at least focal length times turning rate; the fastest hundredth decides."""
    time_s, strides = steps(Renderer(thrown(0.0, 0.06, turning=2.0), CAMERA), START_S, STOP_S)
    rays = (CAMERA.pixels()[0, :, 0] - CAMERA.cx) / CAMERA.fx
    fastest = np.percentile(CAMERA.fx * 2.0 * (1 + rays**2), 99)
    assert 0.8 * STEP_PX < fastest * (time_s[1] - time_s[0]) <= 1.03 * STEP_PX
    assert (strides == 1).mean() > 0.9
