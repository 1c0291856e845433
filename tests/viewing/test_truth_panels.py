import numpy as np
import pytest
from pytest import approx

from evimo.errors import BadInput
from evimo.events.slices import Slice
from evimo.geometry.camera import Camera
from evimo.recordings.truth import ObjectTruth, Truth
from evimo.viewing.colours import STATIC, X_AXIS, direction_colours, id_colour
from evimo.viewing.layout import layout_of
from evimo.viewing.truth_panels import WITH_INTENSITY, WITHOUT_INTENSITY, TruthPanels, depth_bounds

SIZE = (180, 240)
CAMERA = Camera(200.0, 200.0, 119.5, 89.5, *SIZE)
BOX = (100, 60, 160, 120)


def truth_of(velocity=(0.0, 0.0, 0.0), *, ego=(0.0,) * 6, size=SIZE, t_us=12_500, **changed):
    """A square that is object 1 before a wall at 2 m."""
    ids = np.zeros(size, np.uint8)
    ids[BOX[1] : BOX[3] + 1, BOX[0] : BOX[2] + 1] = 1
    depth = np.where(ids, 1, 2).astype(np.float32)
    objects = {1: ObjectTruth(np.zeros(3), np.array(velocity, float), np.zeros(3))}
    fields = dict(t_us=t_us, depth=depth, valid=depth > 0, ids=ids, clutter=np.zeros(size, bool))
    return Truth(**{**fields, "ego": np.array(ego, float), "objects": objects, **changed})


@pytest.fixture
def part(make_events):
    return Slice(0, 0, 25_000, make_events((3, 4, 1)))


def panels_of(part, truth, *, light=None, bounds=(0.5, 8.0), camera=CAMERA):
    """Name of each panel to its picture in a fresh frame."""
    names = WITHOUT_INTENSITY if light is None else WITH_INTENSITY
    image = TruthPanels(camera, bounds=bounds, intensity=light is not None).draw(
        part, truth, time_origin_us=0, light=light
    )
    boxes = layout_of(camera.size, rows=2, columns=len(names) // 2).images
    return {name: box.of(image) for name, box in zip(names, boxes, strict=True)}


@pytest.mark.parametrize("size", [(260, 346), (180, 190), (480, 640), (720, 1280), (346, 260)])
@pytest.mark.parametrize("light", [False, True])
def test_a_frame_of_any_sensor(part, size, light):
    camera = Camera(200.0, 200.0, 100.0, 90.0, *size)
    picture = np.full(size, 0.5, np.float32) if light else None
    assert len(panels_of(part, truth_of(size=size), camera=camera, light=picture)) == (6 if light else 4)


def test_the_object_has_its_colour_and_static_clutter_is_striped_grey(part):
    clutter = np.zeros(SIZE, bool)
    clutter[20:50, 20:70] = True
    light = np.zeros(SIZE, np.float32)
    panel = panels_of(part, truth_of(clutter=clutter), light=light)["objects"]
    inside = panel[60:90, 60:120].reshape(-1, 3)
    share = np.all(inside == STATIC, axis=-1).mean()
    assert share == approx(2 / 7, abs=0.02)
    grey_only = panel[:110].astype(int)
    assert np.ptp(grey_only, axis=-1).max() < 25
    fill = panel[130, 215].astype(float) - panel[320, 20]
    assert np.corrcoef(fill, np.array(id_colour(1), float) - panel[320, 20])[0, 1] > 0.999


def test_depth_is_coloured_between_the_bounds_and_hatched_where_unknown(part):
    valid = np.ones(SIZE, bool)
    valid[:, :20] = False
    near, far = (panels_of(part, truth_of(valid=valid), bounds=bounds)["depth"] for bounds in ((2.0, 16.0), (0.5, 2.0)))
    assert near[300, 300].astype(int).sum() > far[300, 300].astype(int).sum() + 100  # the same wall at 2 m
    assert len(np.unique(near[:, :40].reshape(-1, 3), axis=0)) == 2


def test_a_camera_that_goes_right_sees_everything_go_left(part):
    panel = panels_of(part, truth_of(ego=(1.0, 0, 0, 0, 0, 0)))["flow"]
    wall_px, square_px = -200 / 2, -200 / 1
    wall, square = (direction_colours(np.array([speed, 0.0]), full=200) for speed in (wall_px, square_px))
    assert panel[20, 20].tolist() == wall.tolist()
    assert panel[180, 260].tolist() == square.tolist()


def test_an_object_that_moves_right_has_an_arrow_to_the_right(part):
    for light, name in ((None, "objects"), (np.zeros(SIZE, np.float32), "velocity")):
        still, moving = (panels_of(part, truth_of(v), light=light)[name].copy() for v in ((0, 0, 0), (0.5, 0, 0)))
        white = (moving.min(-1) > 215) & (still.min(-1) <= 215)
        columns = np.nonzero(white)[1]
        assert columns.min() > 250 and columns.max() > 330


def test_light_is_shown_from_black_to_white(part):
    light = np.tile(np.linspace(0, 1.2, SIZE[1], dtype=np.float32), (SIZE[0], 1))
    panel = panels_of(part, truth_of(), light=light)["intensity"].astype(int)
    assert np.ptp(panel, axis=-1).max() == 0
    row = panel[100, :, 0]
    assert (row[0], row[-1]) == (0, 255) and np.all(np.diff(row) >= 0)
    assert row[100] > 100  # light is not linear on a screen


def test_camera_motion_is_plotted(part):
    panels = TruthPanels(CAMERA, bounds=(0.5, 8.0), intensity=False)
    for k in range(40):
        image = panels.draw(part, truth_of(ego=(0.4, 0, 0, 0, 0, 0), t_us=k * 25_000), time_origin_us=0)
    bar = layout_of(SIZE).sidebar.of(image)
    assert np.count_nonzero(np.all(bar == X_AXIS, axis=-1)) > 150


def test_nothing_known_is_drawn(part):
    nothing = dict(depth=np.zeros(SIZE, np.float32), valid=np.zeros(SIZE, bool), ids=np.zeros(SIZE, np.uint8))
    panels_of(part, truth_of(**nothing))
    assert depth_bounds([truth_of(**nothing)]) == (0.5, 8.0)


def test_bounds_are_powers_of_two_around_the_depths():
    assert depth_bounds([truth_of()]) == (1.0, 2.0)
    deep = truth_of(depth=np.full(SIZE, 3.0, np.float32))
    assert depth_bounds([truth_of(), deep]) == (1.0, 4.0)
    assert depth_bounds([truth_of(depth=np.full(SIZE, 4.0, np.float32))]) == (4.0, 8.0)


def test_maps_of_another_size_are_refused(part):
    with pytest.raises(BadInput, match="346x260 px for panels of 240x180"):
        panels_of(part, truth_of(size=(260, 346)))
    with pytest.raises(ValueError, match="intensity"):
        TruthPanels(CAMERA, bounds=(0.5, 8.0), intensity=True).draw(part, truth_of(), time_origin_us=0)
