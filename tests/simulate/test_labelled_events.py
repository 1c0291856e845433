"""What events say of the object they saw, against the truth rendered at their own time."""

import numpy as np
import pytest

from evimo.events.events import Events
from evimo.geometry.camera import Camera
from evimo.scene.bodies import BOX, CYLINDER, Body, Part, Scene, Surface
from evimo.scene.motion import Motion
from evimo.scene.renderer import Renderer
from evimo.scene.textures.bank import texture_bank
from evimo.simulate.labelled_events import LabelledEvents
from evimo.simulate.plan import RecordingPlan
from evimo.simulate.recording import SimulatedRecording
from evimo.simulate.sensor import SensorSettings

CAMERA = Camera(fx=60.0, fy=60.0, cx=31.5, cy=23.5, height=48, width=64)
SPEED_M_S = 3.0  # at 2 m: 90 px/s, so that a slice's centre is 1.1 px from its ends


@pytest.fixture(scope="module")
def recording():
    """A dark disc that flies past a bright wall, seen by a camera at rest."""
    bank = texture_bank(7, plain=2, dense=10)

    def part(shape, half, position, grey, **how):
        surface = Surface(0, 0.5, (0.1, 0.2), grey, grey)  # nothing but its edges fires
        return Part(shape, np.array(half), np.array(position, float), np.eye(3), surface, **how)

    room = Body((part(BOX, (4.0, 4.0, 4.0), (0, 0, 0), 0.9, inside=True),))
    way = Motion(np.array([-0.4, 0, 2.0]), np.eye(3), (lambda t: (np.outer(t, [SPEED_M_S, 0, 0]), _steady(t)),))
    disc = Body((part(CYLINDER, (0.4, 0.4, 0.02), (0, 0, 0), 0.1),), way)
    scene = Scene((room, disc), Motion(np.zeros(3), np.eye(3)), np.array([0, 0, -1.0]), 0.5, bank)
    settings = SensorSettings(shot_hz=4.0, jitter_s=50e-6)
    return SimulatedRecording(RecordingPlan(seed=3, seconds=0.1), CAMERA, scene, settings)


def _steady(time_s):
    return np.tile([SPEED_M_S, 0, 0], (len(time_s), 1))


def test_an_event_is_of_what_its_pixel_sees_at_its_own_time(recording):
    """Even behind and before the disc's edges, where the slice's centre is often wrong."""
    renderer = Renderer(recording.scene, recording.camera)
    own, centre = [], []
    for piece in recording:
        events = piece.events
        assert piece.event_ids.dtype == np.uint8
        assert len(piece.event_ids) == len(events)
        for k in range(0, len(events), 2):
            true = renderer.truth(int(events.t[k])).ids[events.y[k], events.x[k]]
            own.append(piece.event_ids[k] == true)
            centre.append(piece.truth.ids[events.y[k], events.x[k]] == true)
    assert len(own) > 300
    assert 0.2 < np.mean([(piece.event_ids > 0).mean() for piece in recording]) < 0.95
    assert np.mean(own) > 0.955  # jitter puts some across the edge, noise is at its start
    assert np.mean(centre) < 0.9


def test_ids_stay_with_their_events_through_sorting_and_cutting():
    rng = np.random.default_rng(0)

    def some(start_us):
        t = np.sort(rng.integers(start_us, start_us + 100, 40))
        x = rng.integers(0, 200, 40).astype(np.uint16)
        return LabelledEvents(Events(x, x, t, np.ones(40, np.int8)), (x % 7).astype(np.uint8))

    both = some(0).merged(some(50))
    assert (np.diff(both.events.t) >= 0).all()
    for part in (both, both.between(30, 90)):
        np.testing.assert_array_equal(part.ids, part.events.x % 7)
    assert len(both.between(30, 90).ids) == len(both.events.between(30, 90)) > 0
