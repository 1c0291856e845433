import numpy as np
import pytest

from evimo.errors import BadInput
from evimo.simulate.cameras import EVIMO, draw_camera


def drawn(count=200, size=(65, 86)):
    return [draw_camera(np.random.default_rng(seed), "random", size) for seed in range(count)]


def test_focal_lengths_span_what_the_network_should_serve():
    focal = np.array([camera.fx / camera.width for camera in drawn()])
    assert focal.min() > 0.5
    assert focal.max() < 1.1
    assert np.ptp(focal) > 0.4
    assert np.median(focal) == pytest.approx(0.77, abs=0.05)


def test_every_pixel_has_a_direction_and_lenses_differ():
    cameras = drawn(60)
    assert all(camera.normalised(camera.pixels())[1].all() for camera in cameras)
    strongest = min(camera.distortion[0] for camera in cameras if camera.distortion)
    assert strongest < -0.3
    assert 0.1 < np.mean([camera.is_pinhole for camera in cameras]) < 0.45


def test_evimo_is_scaled_to_the_size():
    assert draw_camera(np.random.default_rng(0), "evimo", EVIMO.size) == EVIMO
    half = draw_camera(np.random.default_rng(0), "evimo", (130, 173))
    assert half.size == (130, 173)
    assert half.fx == pytest.approx(EVIMO.fx / 2)
    assert half.distortion == EVIMO.distortion


def test_another_camera_is_refused():
    with pytest.raises(BadInput, match="random or evimo"):
        draw_camera(np.random.default_rng(0), "pinhole", (10, 10))
