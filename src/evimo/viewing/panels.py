"""One frame of the video: events, moving objects, depth, velocity and camera motion of one slice."""

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadInput
from evimo.events.events import Events
from evimo.recordings.estimate import Estimate
from evimo.viewing.colours import BACKDROP, CARD, MOVING_WITHOUT_ID, Image, depth_table, id_colour, id_table, painted
from evimo.viewing.history import History
from evimo.viewing.layout import layout_of
from evimo.viewing.legends import titles
from evimo.viewing.maps import (
    Zoom,
    depth_picture,
    event_levels,
    grey_table,
    hatch,
    hatched,
    outline,
    polarity_table,
    tinted,
)
from evimo.viewing.objects import LONGEST_ARROW, draw_velocities, label_objects, velocity_table
from evimo.viewing.sidebar import Sidebar


class Panels:
    """Draws estimates of one sensor, slice after slice; it remembers two seconds of motion for the plots.

    Args:
        size: (height, width) of the sensor.

    Raises:
        BadInput: the size is not positive.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        if min(size) < 1:
            raise BadInput(
                f"a sensor of {size[1]}x{size[0]} px cannot be drawn", fix="give (height, width), both positive"
            )
        self._layout = layout_of(size)
        self._zoom = Zoom(sensor=size, shown=(self._layout.images[0].height, self._layout.images[0].width))
        self._history = History()
        self._tables = {"polarity": polarity_table(), "grey": grey_table(190), "dim": grey_table(120)}
        self._depth_table, self._id_table = depth_table(), id_table()
        self._hatch = hatch(self._zoom.shown)
        self._sidebar = Sidebar(self._layout.sidebar, longest_arrow=LONGEST_ARROW * self._zoom.shown[1])
        self._empty = np.full((*self._layout.frame, 3), BACKDROP, np.uint8)
        for box in self._layout.images:
            box.of(self._empty)[:] = CARD
        titles(self._empty, self._layout)
        self._sidebar.prepare(self._empty)

    @property
    def frame(self) -> tuple[int, int]:
        """(height, width) of every drawn frame, even."""
        return self._layout.frame

    def draw(self, estimate: Estimate, events: Events, *, time_origin_us: int) -> Image:
        """Draw one slice.

        Args:
            estimate: maps in sensor pixels, of the size given at the start.
            events: those of the slice; events outside the sensor are left out.
            time_origin_us: absolute time shown as 0 s.

        Returns:
            (height, width, 3) uint8 RGB, a new array.

        Raises:
            BadInput: the maps have another size than the sensor.
        """
        if estimate.ids.shape != self._zoom.sensor:
            shapes = [f"{shape[1]}x{shape[0]}" for shape in (estimate.ids.shape, self._zoom.sensor)]
            raise BadInput(
                f"maps of {shapes[0]} px for panels of {shapes[1]} px", fix="make Panels of the recording's sensor size"
            )
        self._history.add(estimate)
        image = self._empty.copy()
        boxes, levels = self._layout.images, event_levels(events, self._zoom)
        self._zoom.enlarge(painted(levels, self._tables["polarity"]), into=boxes[0].of(image))
        self._draw_mask(boxes[1].of(image), estimate, levels)
        self._draw_depth(boxes[2].of(image), estimate)
        self._draw_velocity(boxes[3].of(image), estimate, levels)
        self._sidebar.draw(image, estimate, events=len(events), history=self._history, time_origin_us=time_origin_us)
        return image

    def _draw_mask(self, panel: Image, estimate: Estimate, levels: NDArray[np.uint8]) -> None:
        ids, valid = self._zoom.reduced(estimate.ids), self._zoom.reduced(estimate.valid)
        moving = self._zoom.reduced(estimate.moving)
        picture = painted(levels, self._tables["grey"])
        tint = painted(ids, self._id_table)
        tint[moving & (ids == 0)] = MOVING_WITHOUT_ID
        tinted(picture, tint, mask=(ids > 0) | moving)
        self._zoom.enlarge(picture, into=panel)
        hatched(panel, self._hatch, unknown=~valid)
        for one in estimate.objects:
            outline(panel, ids == one.id, zoom=self._zoom, colour=id_colour(one.id))
        label_objects(panel, estimate.objects, zoom=self._zoom)

    def _draw_depth(self, panel: Image, estimate: Estimate) -> None:
        known = estimate.valid & np.isfinite(estimate.rel_depth) & (estimate.rel_depth > 0)
        known, depth = self._zoom.reduced(known), self._zoom.reduced(estimate.rel_depth)
        self._zoom.enlarge(depth_picture(depth, known=known, table=self._depth_table), into=panel)
        hatched(panel, self._hatch, unknown=~known)

    def _draw_velocity(self, panel: Image, estimate: Estimate, levels: NDArray[np.uint8]) -> None:
        full = self._history.speed_limit
        ids, picture = self._zoom.reduced(estimate.ids), painted(levels, self._tables["dim"])
        colours = velocity_table(estimate.objects, full=full)
        tinted(picture, painted(ids, colours), mask=ids > 0)
        self._zoom.enlarge(picture, into=panel)
        hatched(panel, self._hatch, unknown=~self._zoom.reduced(estimate.valid))
        for one in estimate.objects:
            red, green, blue = colours[one.id].tolist()
            outline(panel, ids == one.id, zoom=self._zoom, colour=(red, green, blue))
        draw_velocities(panel, estimate.objects, zoom=self._zoom, full=full)
