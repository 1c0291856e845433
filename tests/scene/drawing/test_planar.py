"""Planar scenes: everything in view is one plane straight ahead, and the camera turns about its axis alone."""

import numpy as np
import pytest

from evimo.recordings.flow import true_flow
from evimo.scene.drawing.planar import draw_planar_scene
from evimo.scene.drawing.scenes import SETS
from evimo.scene.renderer import Renderer
from evimo.simulate.cameras import EVIMO
from evimo.simulate.plan import RecordingPlan
from evimo.simulate.recording import simulate_recording

SECONDS = 3.0
CAMERA = EVIMO.resized(65, 87)


@pytest.fixture(scope="module")
def scenes(bank):
    return [draw_planar_scene(np.random.default_rng((3, k)), SETS[2], bank, seconds=SECONDS) for k in range(12)]


def test_a_camera_neither_rolls_nor_pitches_but_moves_and_yaws(scenes):
    poses = [scene.camera.at(np.linspace(0, SECONDS, 60)) for scene in scenes]
    spins, velocities = (np.concatenate([getattr(each, name) for each in poses]) for name in ("spin", "velocity"))
    assert np.abs(spins[:, :2]).max() < 1e-12
    assert np.abs(spins[:, 2]).mean() > 0.05
    assert np.abs(velocities).mean(axis=0).min() > 0.03
    for each in poses:
        assert np.linalg.norm(each.velocity, axis=1).min() > 1e-3  # a hand turns round, but does not stand still
        assert np.allclose(each.rotation[:, :, 2], (0, 1, 0))  # the optical axis meets the far wall at right angles


def test_short_scenes_move_too(bank):
    for k in range(30):
        scene = draw_planar_scene(np.random.default_rng((4, k)), SETS[2], bank, seconds=0.2)
        assert np.linalg.norm(scene.camera.at(np.linspace(0, 0.2, 9)).velocity, axis=1).max() > 0.01


def test_nothing_in_view_has_depth_or_moves_by_itself(scenes):
    grid = np.moveaxis(CAMERA.normalised(CAMERA.pixels())[0], -1, 0)
    for scene in scenes:
        truth = Renderer(scene, CAMERA).truth(1_500_000)
        seen = truth.depth[truth.valid]
        near = np.abs(seen / np.median(seen) - 1) < 0.01
        assert near.mean() > 0.9  # the rest is a corner of the room in the margin of the lens
        assert not truth.ids.any() and not truth.objects
        on_wall = truth.valid & (np.abs(truth.depth / np.median(seen) - 1) < 0.003)
        four = fitted_to_four_parameters(true_flow(truth, grid), grid, on_wall)
        assert four < 0.03


def fitted_to_four_parameters(flow, grid, pixels):
    """What shift, expansion and turn leave of the flow, in shares of it, by least squares."""
    (x, y), (u, v) = grid[:, pixels], flow[:, pixels]
    one, zero = np.ones_like(x), np.zeros_like(x)
    system = np.concatenate([np.stack((one, zero, x, -y), axis=1), np.stack((zero, one, y, x), axis=1)])
    wanted = np.concatenate([u, v])
    found = np.linalg.lstsq(system, wanted, rcond=None)[0]
    return np.linalg.norm(system @ found - wanted) / np.linalg.norm(wanted)


def test_a_recording_says_that_it_is_planar_and_can_be_told_again():
    plan = RecordingPlan(
        seed=4, set_number=2, seconds=0.05, camera="evimo", size=(24, 32), part="test", population="planar"
    )
    recording = simulate_recording(plan)
    facts = recording.facts()
    assert (facts["population"], facts["background"], facts["movers"], facts["objects"]) == ("planar", "planar", 0, {})
    pieces = list(recording)
    assert len(pieces) == 2 and all((piece.truth.ego[3:5] == 0).all() for piece in pieces)
