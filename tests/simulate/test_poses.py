"""Poses, against the twists that come from another part of the code."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from evimo.simulate.plan import RecordingPlan
from evimo.simulate.recording import simulate_recording

STEP_US = 200


@pytest.fixture(scope="module")
def recording():
    """One with two movers at least."""
    return first(set_number=3, seconds=0.1, movers=(2, 3))


def first(*, set_number, seconds, movers):
    """The first recording of a set with so many movers."""
    drawn = (
        simulate_recording(RecordingPlan(seed=seed, set_number=set_number, seconds=seconds, size=(33, 44)))
        for seed in range(60)
    )
    return next(recording for recording in drawn if len(recording.scene.movers) in movers)


def twist(matrices):
    """Velocity of the origin, and angular velocity in the moving body's axes, at the middle of three poses."""
    before, now, after = matrices
    span_s = 2 * STEP_US * 1e-6
    turn = Rotation.from_matrix(before[:3, :3].T @ after[:3, :3]).as_rotvec() / span_s
    return (after[:3, 3] - before[:3, 3]) / span_s, turn, now[:3, :3]


def test_poses_differ_by_the_exact_twists(recording):
    for piece in recording:
        truth = piece.truth
        track = recording.poses(truth.t_us + np.array([-STEP_US, 0, STEP_US]))
        velocity, turn, world_from_cam = twist(track.world_from_cam)
        np.testing.assert_allclose(world_from_cam.T @ velocity, truth.ego[:3], atol=1e-3)
        np.testing.assert_allclose(turn, truth.ego[3:], atol=1e-3)
        assert track.object_ids.tolist() == sorted(truth.objects)
        for index, moved in enumerate(truth.objects[id_] for id_ in track.object_ids.tolist()):
            velocity, turn, world_from_object = twist(track.world_from_cam @ track.cam_from_object[:, index])
            np.testing.assert_allclose(world_from_cam.T @ velocity, moved.velocity, atol=1e-3)
            np.testing.assert_allclose(world_from_cam.T @ world_from_object @ turn, moved.rotation, atol=1e-3)
            np.testing.assert_allclose(track.cam_from_object[1, index, :3, 3], moved.position, atol=1e-9)


def test_a_scene_without_movers_has_no_objects():
    recording = first(set_number=1, seconds=0.05, movers=(0,))
    track = recording.poses(np.array([0, 5000]))
    assert track.cam_from_object.shape == (2, 0, 4, 4)
    assert track.object_ids.shape == (0,)
