"""What stands in a Rerun file of a recording with truth, by Rerun's own reader."""

import cv2
import numpy as np
import pytest

from evimo.cli import main
from evimo.formats.saving import save_events

rerun = pytest.importorskip("rerun", reason="needs rerun-sdk: pip install 'evimo[view]'")

CENTRES_US = [12_500, 37_500, 62_500, 87_500, 112_500, 137_500]


@pytest.fixture
def shown(film, tmp_path, read_back):
    out = tmp_path / "film.rrd"
    assert main(["view", str(film), "--save", str(out)]) == 0
    return read_back(out)


def test_a_planted_pose_stands_at_its_time_where_it_was_planted(shown):
    places = shown.rows("world/camera", "Transform3D:translation")
    turned = shown.rows("world/camera", "Transform3D:mat3x3")
    np.testing.assert_allclose(places[100_000][0], (0.5 + 0.08, -2, 1.25), atol=1e-6)  # 0.8 m/s for 0.1 s
    columns = np.array(turned[100_000][0]).reshape(3, 3)  # Rerun stores matrices column by column
    np.testing.assert_allclose(columns[2], (0, 1, 0), atol=1e-6)  # the optical axis is the world's y
    np.testing.assert_allclose(columns[1], (0, 0, -1), atol=1e-6)  # down in the picture is down in the world
    assert sorted(places) == list(range(0, 150_000, 5_000))


def test_an_object_stands_in_the_world_where_it_was_planted(shown):
    places = shown.rows("world/objects/1", "Transform3D:translation")
    np.testing.assert_allclose(places[0][0], (0.5 + 0.1, -2 + 1.0, 1.25 + 0.2), atol=1e-6)
    ((way,),) = shown.rows("world/trajectories/object_1", "LineStrips3D:strips").values()
    np.testing.assert_allclose(way[-1], (0.6 + 0.8 * 0.145, -1, 1.45), atol=1e-6)


def test_depth_becomes_points_where_its_pixels_look(shown):
    points = np.array(shown.rows("world/camera/truth/points", "Points3D:positions")[12_500])
    assert len(points) == 23 * 32  # one row is unknown
    centre = points[np.abs(points[:, :2] - np.array((20 - 15.5, 11 - 11.5)) / 30 * 2).max(axis=1) < 1e-6]
    np.testing.assert_allclose(centre[:, 2], [2.0], atol=1e-6)
    assert sorted(np.unique(points[:, 2]).tolist()) == [1.0, 2.0]


def test_static_points_become_the_room_in_the_world(shown):
    rooms = shown.rows("world/room", "Points3D:positions")
    assert sorted(rooms) == CENTRES_US
    for points in map(np.array, rooms.values()):
        np.testing.assert_allclose(points[:, 1], 0.0, atol=1e-6)  # the wall, 2 m before a camera at y = -2


def test_pictures_hold_events_masks_and_depth(shown):
    def picture(entity):
        (buffer,) = shown.rows(f"world/camera/image/{entity}", "SegmentationImage:buffer")[37_500]
        return np.array(buffer, np.uint8).reshape(24, 32)

    levels = picture("events")
    assert (levels[5, 3], levels[7, 20], np.count_nonzero(levels)) == (3, 4, 2)  # three, the last darker; one brighter
    ids = picture("truth/objects")
    assert (ids[8, 4], ids[8, 5], ids[15, 14], ids[16, 14]) == (0, 1, 1, 0)
    (png,) = shown.rows("world/camera/image/truth/depth", "EncodedDepthImage:blob")[37_500]
    depth = cv2.imdecode(np.array(png, np.uint8), cv2.IMREAD_UNCHANGED)
    assert (depth[0, 0], depth[8, 4], depth[8, 5]) == (0, 2000, 1000)
    unknown = picture("truth/depth/unknown")
    assert unknown[0].all() and not unknown[1:].any()


def test_speeds_are_curves(shown):
    for entity, expected in (("translation/truth", 0.8), ("rotation/truth", 30.0), ("objects/truth/1", 0.4)):
        curve = shown.rows(f"speeds/{entity}", "Scalars:scalars")
        assert sorted(curve) == CENTRES_US
        np.testing.assert_allclose([value for (value,) in curve.values()], expected, rtol=1e-6)


def test_a_part_shows_that_part_alone(film, tmp_path, read_back):
    out = tmp_path / "part.rrd"
    assert main(["view", str(film), "--start", "0.05", "--stop", "0.1", "--save", str(out)]) == 0
    part = read_back(out)
    assert sorted(part.rows("world/room", "Points3D:positions")) == [62_500, 87_500]
    assert sorted(part.rows("world/camera", "Transform3D:translation")) == list(range(50_000, 100_000, 5_000))


def test_times_are_those_of_the_recordings_own_clock(tmp_path, read_back):
    from evimo.events.events import Events

    start_us = 1_700_000_000_000_000  # some day in 2023
    t = start_us + np.arange(0, 100_000, 500)
    some = Events(*(np.full(len(t), 3, np.uint16),) * 2, t, np.ones(len(t), np.int8))
    save_events([some], tmp_path / "e.aedat4", size=(24, 32)) if _writes_aedat4() else pytest.skip("no dv-processing")
    assert main(["view", str(tmp_path / "e.aedat4"), "--save", str(tmp_path / "e.rrd")]) == 0
    file = read_back(tmp_path / "e.rrd")
    assert sorted(file.rows("world/camera/image/events", "SegmentationImage:buffer"))[0] == start_us + 12_500
    assert "/world/camera/truth/points" not in file.chunks


def _writes_aedat4():
    from importlib.util import find_spec

    return find_spec("dv_processing") is not None
