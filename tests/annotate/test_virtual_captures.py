"""Virtual captures of scenes that lack something."""

from dataclasses import replace

from evimo.captures.capture import open_capture
from evimo.simulate.virtual_capture import MocapErrors, capture_virtually


def test_a_scene_without_movers_is_captured(filmed, tmp_path):
    still = replace(filmed.scene, bodies=tuple(body for body in filmed.scene.bodies if body.motion is None))
    planted, _ = capture_virtually(replace(filmed, scene=still), tmp_path / "capture", MocapErrors())
    assert not planted.body_from_scan and not open_capture(tmp_path / "capture").objects
