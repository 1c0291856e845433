"""The classical method in the place of the networks, on events of a wall before a camera that really moves."""

import numpy as np
import pytest
from scipy.linalg import expm

from evimo.errors import NotFound
from evimo.events.events import Events
from evimo.geometry.camera import Camera
from evimo.streaming import graphs
from evimo.streaming.four_parameters import FourParameters
from evimo.streaming.models import model_of
from evimo.streaming.pipeline import Run, run

CAMERA = Camera(200.0, 200.0, 130.0, 80.0, 180, 240)  # its centre is not the picture's
DISTANCE_M = 2.0
SECONDS = 0.2


def cam_from_start(twist: np.ndarray, t_s: float) -> np.ndarray:
    """(4, 4), where points are after the camera moved for so long with a twist in its own axes."""
    vx, vy, vz, wx, wy, wz = twist
    rates = np.array([[0, -wz, wy, vx], [wz, 0, -wx, vy], [-wy, wx, 0, vz], [0, 0, 0, 0]])
    return np.linalg.inv(expm(rates * t_s))


def pictured(points: np.ndarray, twist: np.ndarray, t_s: float) -> np.ndarray:
    """Points (4, N) at time 0 in pixels (2, N) at another time."""
    x, y, z, _ = cam_from_start(twist, t_s) @ points
    return np.stack((CAMERA.fx * x / z + CAMERA.cx, CAMERA.fy * y / z + CAMERA.cy))


def wall_events(twist: np.ndarray, *, seed: int = 0) -> Events:
    """Edges on a wall two metres away, seen by a camera with that twist in m/s and rad/s."""
    random = np.random.default_rng(seed)
    edges, per_ms, milliseconds = 250, 500, round(SECONDS * 1000)
    middle, angle = random.uniform((-2.2, -1.8), (2.2, 1.8), (edges, 2)), random.uniform(0, np.pi, edges)
    length = random.uniform(0.1, 0.5, edges)
    columns: list[np.ndarray] = []
    for number in range(milliseconds):
        edge, along = random.integers(0, edges, per_ms), random.uniform(-0.5, 0.5, per_ms)
        way = np.stack((np.cos(angle[edge]), np.sin(angle[edge])))
        at = middle[edge].T + along * length[edge] * way
        points = np.concatenate((at, np.full((1, per_ms), DISTANCE_M), np.ones((1, per_ms))))
        x, y = np.rint(pictured(points, twist, number * 1e-3))
        seen = (x >= 0) & (x < CAMERA.width) & (y >= 0) & (y < CAMERA.height)
        columns.append(np.stack((np.full(per_ms, number * 1000.0), x, y))[:, seen])
    t, x, y = np.concatenate(columns, axis=1)
    p = np.where(random.random(len(t)) < 0.5, 1, -1).astype(np.int8)
    return Events(x.astype(np.uint16), y.astype(np.uint16), t.astype(np.int64), p)


TWISTS = {
    "shift": (0.8, -0.5, 0, 0, 0, 0),
    "approach": (0, 0, 1.2, 0, 0, 0),
    "turn": (0, 0, 0, 0, 0, -1.2),
    "all": (0.5, 0.5, 0.6, 0, 0, 0.8),
}


@pytest.mark.parametrize("name", TWISTS)
def test_egomotion_and_flow_before_a_wall_are_the_camera_s(name):
    """Lengths are in mean depths: two metres here."""
    twist = np.array(TWISTS[name])
    estimates = list(run(wall_events(twist), model="classical", camera=CAMERA))[1:-1]
    ego = np.median([each.ego for each in estimates], axis=0)
    np.testing.assert_allclose(ego[:3], twist[:3] / DISTANCE_M, atol=0.08)
    np.testing.assert_allclose(ego[5], twist[5], atol=0.15)
    middle = estimates[len(estimates) // 2]
    rows, columns = np.mgrid[20:160:20, 20:220:20]
    rays = np.stack(((columns - CAMERA.cx) / CAMERA.fx, (rows - CAMERA.cy) / CAMERA.fy, np.ones(rows.shape)))
    at = (rays * 1.0).reshape(3, -1) * DISTANCE_M
    points = np.concatenate((at, np.ones((1, at.shape[1]))))
    change = (pictured(points, twist, 1e-4) - pictured(points, twist, -1e-4)) / 2e-4
    flow = middle.flow[:, rows, columns].reshape(2, -1) * CAMERA.fx
    assert np.median(np.hypot(*(flow - change))) < 25  # px/s, of 40 to 150


def test_what_one_plane_cannot_say_is_left_out():
    """No roll, no pitch, no depth."""
    for each in run(wall_events(np.array([0.5, 0, 0, 0.3, -0.3, 0])), model="classical", camera=CAMERA):
        assert not each.ego[3:5].any()
        assert (each.rel_depth == 1).all()
        assert all(moving.rel_distance == 1 and moving.rel_velocity[2] == 0 for moving in each.objects)


def test_a_slice_s_estimate_is_the_same_in_any_span():
    events = wall_events(np.array(TWISTS["all"]))
    whole = list(run(events, model="classical", camera=CAMERA))
    part = list(run(events, model="classical", camera=CAMERA, start_s=0.075, stop_s=0.125))
    assert [each.t_us for each in part] == [each.t_us for each in whole[3:5]]
    for one, other in zip(part, whole[3:5], strict=True):
        np.testing.assert_array_equal(one.moving_probability, other.moving_probability)
        np.testing.assert_array_equal(one.flow, other.flow)
        np.testing.assert_array_equal(one.ego, other.ego)


def test_no_weights_are_needed_and_no_gyroscope_is_asked(discs, recorded, camera, monkeypatch):
    monkeypatch.setattr(graphs, "presets", dict)

    def never():
        raise AssertionError

    prepared = Run(recorded(discs, read_gyroscope=never), model_of("classical"), camera=camera)
    assert len(list(prepared.slices())) == len(prepared.span)
    assert "classical" in prepared.rotation.said


def test_parameters_tell_models_apart():
    from evimo.classical.compensation import Parameters

    model, other = FourParameters(), FourParameters(Parameters(threshold=2.5))
    assert model.name == other.name == "classical"
    assert model.identity != other.identity
    assert "threshold 2.5" in other.identity["parameters"]


def test_an_unknown_model_s_error_names_the_one_without_weights():
    with pytest.raises(NotFound, match="classical"):
        model_of("clasical")
