"""The panels themselves: maps of one sensor painted into boxes of one size, whatever made the maps."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from evimo.viewing.colours import (
    DEPTH_RANGE,
    MOVING_WITHOUT_ID,
    STATIC,
    Image,
    depth_table,
    direction_colours,
    id_colour,
    id_table,
    painted,
)
from evimo.viewing.maps import (
    Zoom,
    depth_picture,
    grey_table,
    hatch,
    hatched,
    outline,
    polarity_table,
    striped,
    stripes,
    tinted,
)
from evimo.viewing.moment import Mark
from evimo.viewing.objects import draw_velocities, label_objects, velocity_table

GAMMA = 2.2
"""Between light and the numbers of a picture."""


class Painter:
    """Paints in place; every map is (H, W) in sensor pixels, `levels` are `event_levels`."""

    def __init__(self, zoom: Zoom) -> None:
        self.zoom = zoom
        self._tables = {"polarity": polarity_table(), "grey": grey_table(190), "dim": grey_table(120)}
        self._depth_table, self._id_table = depth_table(), id_table()
        self._hatch, self._stripes = hatch(zoom.shown), stripes(zoom.shown)

    def intensity(self, panel: Image, light: NDArray[np.float32]) -> None:
        """A picture of linear light, 1 is white."""
        grey = np.rint(255 * np.clip(self.zoom.reduced(light), 0, 1) ** (1 / GAMMA)).astype(np.uint8)
        self.zoom.enlarge(np.repeat(grey[..., None], 3, axis=-1), into=panel)

    def events(self, panel: Image, levels: NDArray[np.uint8]) -> None:
        """Red brighter, blue darker."""
        self.zoom.enlarge(painted(levels, self._tables["polarity"]), into=panel)

    def mask(
        self,
        panel: Image,
        levels: NDArray[np.uint8],
        *,
        ids: NDArray[np.uint8],
        moving: NDArray[np.bool_],
        valid: NDArray[np.bool_],
    ) -> None:
        """Objects in the colours of their ids over grey events; `moving` pixels without an id are grey."""
        ids, moving = self.zoom.reduced(ids), self.zoom.reduced(moving)
        picture = painted(levels, self._tables["grey"])
        tint = painted(ids, self._id_table)
        tint[moving & (ids == 0)] = MOVING_WITHOUT_ID
        tinted(picture, tint, mask=(ids > 0) | moving)
        self.zoom.enlarge(picture, into=panel)
        hatched(panel, self._hatch, unknown=~self.zoom.reduced(valid))

    def static(self, panel: Image, mask: NDArray[np.bool_]) -> None:
        """Stripes and an outline over static bodies that look like objects."""
        mask = np.ascontiguousarray(self.zoom.reduced(mask))
        striped(panel, self._stripes, colour=STATIC, mask=mask)
        outline(panel, mask, zoom=self.zoom, colour=STATIC)

    def outlines(self, panel: Image, ids: NDArray[np.uint8], marks: Sequence[Mark]) -> None:
        """The border of each object in its colour."""
        ids = self.zoom.reduced(ids)
        for mark in marks:
            outline(panel, ids == mark.id, zoom=self.zoom, colour=id_colour(mark.id))

    def labels(self, panel: Image, marks: Sequence[Mark]) -> None:
        """The id beside each object."""
        label_objects(panel, marks, zoom=self.zoom)

    def arrows(self, panel: Image, marks: Sequence[Mark], *, full: float) -> None:
        """The velocity of each object, and its id and speed beside it."""
        draw_velocities(panel, marks, zoom=self.zoom, full=full)

    def depth(
        self,
        panel: Image,
        depth: NDArray[np.float32],
        *,
        valid: NDArray[np.bool_],
        bounds: tuple[float, float] = DEPTH_RANGE,
    ) -> None:
        """Near is bright; hatched where it is unknown."""
        known = valid & np.isfinite(depth) & (depth > 0)
        known, depth = self.zoom.reduced(known), self.zoom.reduced(depth)
        self.zoom.enlarge(depth_picture(depth, known=known, table=self._depth_table, bounds=bounds), into=panel)
        hatched(panel, self._hatch, unknown=~known)

    def flow(self, panel: Image, flow_px: NDArray[np.float64], *, valid: NDArray[np.bool_], full: float) -> None:
        """The colour of the direction of the image velocity (H, W, 2), pure from the speed `full` on."""
        self.zoom.enlarge(direction_colours(self.zoom.reduced(flow_px), full=full), into=panel)
        hatched(panel, self._hatch, unknown=~self.zoom.reduced(valid))

    def velocity(
        self,
        panel: Image,
        levels: NDArray[np.uint8],
        marks: Sequence[Mark],
        *,
        ids: NDArray[np.uint8],
        valid: NDArray[np.bool_],
        full: float,
    ) -> None:
        """Objects in the colours of their directions over dim events, with arrows; `full` has the longest."""
        ids, picture = self.zoom.reduced(ids), painted(levels, self._tables["dim"])
        colours = velocity_table(marks, full=full)
        tinted(picture, painted(ids, colours), mask=ids > 0)
        self.zoom.enlarge(picture, into=panel)
        hatched(panel, self._hatch, unknown=~self.zoom.reduced(valid))
        for mark in marks:
            red, green, blue = colours[mark.id].tolist()
            outline(panel, ids == mark.id, zoom=self.zoom, colour=(red, green, blue))
        self.arrows(panel, marks, full=full)
