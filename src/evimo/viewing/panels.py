"""One frame of the video: events, moving objects, depth, velocity and camera motion of one slice."""

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadInput
from evimo.events.events import Events
from evimo.recordings.estimate import Estimate
from evimo.viewing.colours import BACKDROP, CARD, MOVING_WITHOUT_ID, Image, depth_table, id_colour, id_table
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
from evimo.viewing.objects import draw_velocities, label_objects, velocity_table
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
            raise BadInput(f"a sensor of {size[1]}x{size[0]} px cannot be drawn", fix="give (height, width), both positive")
        self._layout = layout_of(size)
        self._zoom = Zoom(sensor=size, shown=(self._layout.images[0].height, self._layout.images[0].width))
        self._history = History()
        self._tables = {"polarity": polarity_table(), "grey": grey_table(190), "dim": grey_table(120)}
        self._depth_table, self._id_table = depth_table(), id_table()
        self._hatch = hatch(self._zoom.shown)
        self._sidebar = Sidebar(self._layout.sidebar)
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
            raise BadInput(f"maps of {shapes[0]} px for panels of {shapes[1]} px", fix="make Panels of the recording's sensor size")
        self._history.add(estimate)
        image = self._empty.copy()
        boxes, levels = self._layout.images, event_levels(events, self._zoom)
        boxes[0].of(image)[:] = self._zoom.enlarged(self._tables["polarity"][levels])
        self._draw_mask(boxes[1].of(image), estimate, levels)
        self._draw_depth(boxes[2].of(image), estimate)
        self._draw_velocity(boxes[3].of(image), estimate, levels)
        self._sidebar.draw(image, estimate, events=len(events), history=self._history, time_origin_us=time_origin_us)
        return image

    def _draw_mask(self, panel: Image, estimate: Estimate, levels: NDArray[np.uint8]) -> None:
        ids, valid = self._zoom.reduced(estimate.ids), self._zoom.reduced(estimate.valid)
        moving = self._zoom.reduced(estimate.moving)
        picture = self._tables["grey"][levels]
        tint = self._id_table[ids]
        tint[moving & (ids == 0)] = MOVING_WITHOUT_ID
        tinted(picture, tint, mask=(ids > 0) | moving)
        panel[:] = self._zoom.enlarged(picture)
        hatched(panel, self._hatch, unknown=~valid)
        for one in estimate.objects:
            outline(panel, ids == one.id, zoom=self._zoom, colour=id_colour(one.id))
        label_objects(panel, estimate.objects, zoom=self._zoom)

    def _draw_depth(self, panel: Image, estimate: Estimate) -> None:
        known = estimate.valid & np.isfinite(estimate.rel_depth) & (estimate.rel_depth > 0)
        known, depth = self._zoom.reduced(known), self._zoom.reduced(estimate.rel_depth)
        panel[:] = self._zoom.enlarged(depth_picture(depth, known=known, table=self._depth_table))
        hatched(panel, self._hatch, unknown=~known)

    def _draw_velocity(self, panel: Image, estimate: Estimate, levels: NDArray[np.uint8]) -> None:
        full = self._history.speed_limit
        ids, picture = self._zoom.reduced(estimate.ids), self._tables["dim"][levels]
        colours = velocity_table(estimate.objects, full=full)
        tinted(picture, colours[ids], mask=np.isin(ids, [one.id for one in estimate.objects]))
        panel[:] = self._zoom.enlarged(picture)
        hatched(panel, self._hatch, unknown=~self._zoom.reduced(estimate.valid))
        for one in estimate.objects:
            red, green, blue = colours[one.id].tolist()
            outline(panel, ids == one.id, zoom=self._zoom, colour=(red, green, blue))
        draw_velocities(panel, estimate.objects, zoom=self._zoom, full=full)
