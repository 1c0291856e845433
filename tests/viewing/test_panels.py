from dataclasses import replace

import cv2
import numpy as np
import pytest

from evimo.errors import BadInput
from evimo.viewing import sidebar
from evimo.viewing.colours import BACKDROP, CARD, X_AXIS, id_colour
from evimo.viewing.layout import layout_of
from evimo.viewing.panels import Panels

SIZE = (180, 240)
EVENTS, MASK, DEPTH, VELOCITY = layout_of(SIZE).images


def drawn(estimate, events, size=SIZE):
    return Panels(size).draw(estimate, events, time_origin_us=0)


@pytest.mark.parametrize("size", [(260, 346), (180, 190), (180, 240), (480, 640), (720, 1280), (128, 128)])
def test_a_frame_of_any_sensor(make_estimate, make_square, make_events, size):
    image = drawn(make_estimate(size, make_square(1, (5, 5, 40, 30), (1, 0, 0))), make_events((3, 4, 1)), size)
    assert image.shape == (*Panels(size).frame, 3) and image.dtype == np.uint8
    rim = np.concatenate([image[:6].reshape(-1, 3), image[-6:].reshape(-1, 3), image[:, -6:].reshape(-1, 3)])
    assert np.all(rim == BACKDROP)  # nothing is cut off


def test_red_is_where_it_got_brighter_and_blue_where_darker(make_estimate, make_events):
    panel = EVENTS.of(drawn(make_estimate(SIZE), make_events((10, 20, 1), (200, 100, -1)))).astype(int)
    red, _, blue = np.moveaxis(panel, -1, 0)
    assert np.argwhere(red - blue > 50).tolist() == [[y, x] for y in (40, 41) for x in (20, 21)]
    assert np.argwhere(blue - red > 50).tolist() == [[y, x] for y in (200, 201) for x in (400, 401)]


def test_the_colour_of_an_object_is_inside_its_mask_and_nowhere_else(make_estimate, make_square, make_events):
    one = make_square(2, (100, 60, 160, 120))
    image = MASK.of(drawn(make_estimate(SIZE, one), make_events()))
    empty = MASK.of(drawn(make_estimate(SIZE), make_events()))
    changed = np.any(image != empty, axis=-1)
    mask = np.kron(make_estimate(SIZE, one).ids, np.ones((2, 2))).astype(bool)
    with_rim = cv2.dilate(mask.view(np.uint8), np.ones((5, 5))).astype(bool)  # half a line of the outline
    assert changed[mask].all() and not changed[~with_rim].any()
    fill = image[130, 215].astype(float) - CARD
    assert np.corrcoef(fill, np.array(id_colour(2)) - CARD)[0, 1] > 0.999


def test_ids_keep_their_colour_from_slice_to_slice(make_estimate, make_square, make_events):
    panels, seen = Panels(SIZE), []
    for k in range(3):
        others = [make_square(1, (5, 5, 30, 30))] if k == 1 else []
        estimate = make_estimate(SIZE, make_square(5, (100 + k, 60, 160 + k, 120)), *others, t_us=k * 25_000)
        seen.append(MASK.of(panels.draw(estimate, make_events(), time_origin_us=0))[130, 220].tolist())
    assert seen[0] == seen[1] == seen[2]


def test_moving_pixels_without_an_object_are_grey(make_estimate, make_events):
    probability = np.zeros(SIZE, np.float32)
    probability[50:60, 50:60] = 0.6
    panel = MASK.of(drawn(make_estimate(SIZE, moving_probability=probability), make_events()))
    assert panel[110, 110].max() > 80 and np.ptp(panel[110, 110].astype(int)) < 12
    assert panel[90, 90].tolist() == list(CARD)


def test_the_depth_bar_runs_from_near_to_far(make_estimate, make_events):
    header = layout_of(SIZE).headers[2]

    def position(depth):
        image = drawn(make_estimate(SIZE, rel_depth=np.full(SIZE, depth, np.float32)), make_events())
        bar = image[header.y + 8, header.x + header.width // 2 : header.right].astype(int)
        return int(np.abs(bar - DEPTH.of(image)[180, 240].astype(int)).sum(-1).argmin())

    at = [position(depth) for depth in (0.25, 0.5, 1.0, 2.0, 4.0)]
    assert np.ptp(np.diff(at)) <= 3 and at[0] < at[-1]


def test_unknown_depth_and_invalid_pixels_are_hatched(make_estimate, make_events):
    valid, depth = np.ones(SIZE, bool), np.ones(SIZE, np.float32)
    valid[:, :20], depth[:, 220:] = False, np.nan
    image = drawn(make_estimate(SIZE, valid=valid, rel_depth=depth), make_events())
    for panel in (MASK, DEPTH, VELOCITY):
        left = panel.of(image)[:, :40]
        assert len(np.unique(left.reshape(-1, 3), axis=0)) == 2  # two greys in stripes
        assert np.ptp(left.astype(int), axis=-1).max() < 20
    assert len(np.unique(DEPTH.of(image)[:, 40:440].reshape(-1, 3), axis=0)) == 1
    assert len(np.unique(DEPTH.of(image)[:, 440:].reshape(-1, 3), axis=0)) == 2


def test_an_object_that_moves_right_has_an_arrow_to_the_right(make_estimate, make_square, make_events):
    image = drawn(make_estimate(SIZE, make_square(1, (110, 80, 130, 100), (0.5, 0, 0))), make_events())
    columns = np.nonzero(VELOCITY.of(image).min(-1) > 215)[1]
    assert columns.min() > 230 and columns.max() > 320


def test_camera_motion_to_the_right_raises_the_curve_of_x(make_estimate, make_events):
    def height(vx):
        panels = Panels(SIZE)
        for k in range(40):
            estimate = make_estimate(SIZE, t_us=k * 25_000, ego=np.array([vx, 0, 0, 0, 0, 0]))
            image = panels.draw(estimate, make_events(), time_origin_us=0)
        bar = layout_of(SIZE).sidebar.of(image)
        rows, columns = np.nonzero(np.all(bar == X_AXIS, axis=-1))
        counts = np.bincount(rows[columns > 120])
        return int(counts.argmax())

    assert height(0.4) < height(-0.4) - 50


def test_time_origin_moves_nothing_but_the_clock(make_estimate, make_events):
    one, other = (
        Panels(SIZE).draw(make_estimate(SIZE), make_events(), time_origin_us=origin) for origin in (0, -7_000_000)
    )
    rows, columns = np.nonzero(np.any(one != other, axis=-1))
    sidebar = layout_of(SIZE).sidebar
    assert columns.min() > sidebar.x and rows.max() < sidebar.y + 40


def test_a_slice_without_anything_known_is_drawn(make_estimate, make_events):
    nothing = make_estimate(
        SIZE,
        rel_depth=np.full(SIZE, np.nan, np.float32),
        valid=np.zeros(SIZE, bool),
        ego=np.full(6, np.nan),
    )
    drawn(nothing, make_events())


def test_a_crowd_and_wild_numbers_are_drawn(make_estimate, make_square, make_events):
    rng = np.random.default_rng(0)
    crowd = [
        make_square(k + 1, (int(x), int(y), int(x) + 9, int(y) + 9), rng.normal(0, 300, 3))
        for k, (x, y) in enumerate(zip(rng.integers(0, 230, 40), rng.integers(0, 170, 40), strict=True))
    ]
    drawn(make_estimate(SIZE, *crowd, ego=np.full(6, 1e5)), make_events())


def test_frames_are_new_and_inputs_untouched(make_estimate, make_square, make_events):
    estimate, panels = make_estimate(SIZE, make_square(1, (5, 5, 40, 30), (1, 0, 0))), Panels(SIZE)
    before = estimate.ids.copy(), estimate.rel_depth.copy()
    first = panels.draw(estimate, make_events((3, 4, 1)), time_origin_us=0)
    kept = first.copy()
    panels.draw(make_estimate(SIZE, t_us=37_500), make_events((9, 9, -1)), time_origin_us=0)
    assert np.array_equal(first, kept)
    assert np.array_equal(before[0], estimate.ids) and np.array_equal(before[1], estimate.rel_depth)


def test_maps_of_another_size_are_refused(make_estimate, make_events):
    with pytest.raises(BadInput, match="346x260 px for panels of 240x180"):
        drawn(make_estimate((260, 346)), make_events())
    with pytest.raises(BadInput):
        Panels((0, 240))


def test_a_large_sensor_shows_the_same_places(make_estimate, make_square, make_events):
    """640x480 is reduced, 320x240 of the same scene enlarged: the masks coincide in the frame."""
    frames = [
        drawn(
            make_estimate((240 * k, 320 * k), make_square(1, (100 * k, 60 * k, 160 * k + k - 1, 120 * k + k - 1))),
            make_events(),
            (240 * k, 320 * k),
        )
        for k in (1, 2)
    ]
    areas = [layout_of((240 * k, 320 * k)).images[1].of(frame) for k, frame in zip((1, 2), frames, strict=True)]
    masks = [cv2.absdiff(area, np.full_like(area, CARD)).max(-1) > 40 for area in areas]
    assert np.count_nonzero(masks[0] ^ masks[1]) < 0.05 * np.count_nonzero(masks[0])


def test_what_is_not_estimated_is_hatched_and_said(make_estimate, make_events, monkeypatch):
    estimate = replace(make_estimate(SIZE), moving_probability=None, ids=None, objects=None)
    said = []
    monkeypatch.setattr(sidebar, "write", lambda image, text, at, **how: said.append(text) or at[0])
    image = drawn(estimate, make_events((50, 60, 1)))
    known = drawn(make_estimate(SIZE), make_events((50, 60, 1)))
    for panel, hatched in ((MASK, True), (VELOCITY, True), (DEPTH, False), (EVENTS, False)):
        assert (panel.of(image) != panel.of(known)).any() == hatched
    assert "moving objects not estimated" in said and "0 moving objects" in said
