import numpy as np
import pytest

from evimo.errors import BadInput
from evimo.events.slices import Slice
from evimo.viewing.colours import BACKDROP
from evimo.viewing.event_panel import EventPanel
from evimo.viewing.layout import layout_of


@pytest.mark.parametrize("size", [(260, 346), (180, 240), (720, 1280), (346, 260), (16, 16)])
def test_a_frame_of_any_sensor(make_events, size):
    image = EventPanel(size).draw(Slice(0, 0, 25_000, make_events((3, 4, 1))), time_origin_us=0)
    assert image.dtype == np.uint8 and image.shape[0] % 2 == image.shape[1] % 2 == 0
    rim = np.concatenate([image[:6].reshape(-1, 3), image[-6:].reshape(-1, 3), image[:, -6:].reshape(-1, 3)])
    assert np.all(rim == BACKDROP)


def test_red_is_where_it_got_brighter_and_blue_where_darker(make_events):
    size = (180, 240)
    (box,) = layout_of(size, rows=1, columns=1).images
    part = Slice(0, 0, 25_000, make_events((10, 20, 1), (200, 100, -1)))
    red, _, blue = np.moveaxis(box.of(EventPanel(size).draw(part, time_origin_us=0)).astype(int), -1, 0)
    zoom = box.width // 240
    assert {tuple(at // zoom) for at in np.argwhere(red - blue > 50)} == {(20, 10)}
    assert {tuple(at // zoom) for at in np.argwhere(blue - red > 50)} == {(100, 200)}


def test_the_clock_and_the_count_change_and_frames_are_new(make_events):
    panel, quiet = EventPanel((180, 240)), make_events()
    first = panel.draw(Slice(0, 0, 25_000, quiet), time_origin_us=0)
    kept = first.copy()
    later = panel.draw(Slice(1, 25_000, 50_000, quiet), time_origin_us=0)
    assert np.array_equal(first, kept)
    rows, columns = np.nonzero(np.any(first != later, axis=-1))
    assert len(rows) and rows.max() < 34 and columns.max() < 200


def test_no_sensor_is_refused():
    with pytest.raises(BadInput):
        EventPanel((0, 5))
