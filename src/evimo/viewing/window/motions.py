"""What truth and estimates are drawn with alike: masks, depth, points, arrows and curves."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from evimo.viewing.colours import MUTED, RGB, RULE, X_AXIS, depth_index, depth_table, id_colour, id_table
from evimo.viewing.window.clouds import Cloud
from evimo.viewing.window.entities import OBJECT_SPEEDS, ROTATION, TRANSLATION, UNKNOWN
from evimo.viewing.window.store import Store

ARROW_S = 0.25  # arrows are as long as the way in this time
POINT_PX = 1.6
IDS_LISTED = 32  # that have names and colours; more than any recording has
MASK_OPACITY = 0.5
FADED = 0.55
"""How bright the colours of estimates are beside those of truth."""


@dataclass(frozen=True, slots=True)
class Depths:
    """A map of depths along the optical axis, (H, W).

    known:  (H, W) bool.
    bounds: nearest and farthest depth that colours tell apart, in the unit of the map.
    """

    values: NDArray[np.floating]
    known: NDArray[np.bool_]
    bounds: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Arrow:
    """The velocity of one object: where it is and how it moves, camera axes, in the unit of the scene and per s."""

    id: int
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]

    @property
    def speed(self) -> float:
        """How fast it is."""
        return float(np.linalg.norm(self.velocity))


def log_id_colours(store: Store, entity: str) -> None:
    """Log the colours of ids; the background is transparent."""
    classes = [store.rr.AnnotationInfo(0, "background", (0, 0, 0, 0))]
    classes += [store.rr.AnnotationInfo(key, f"object {key}", id_colour(key)) for key in range(1, IDS_LISTED)]
    store.log_always(entity, store.rr.AnnotationContext(classes))


def ids_image(store: Store, ids: NDArray[np.integer]) -> Any:
    """A map of ids (H, W) to lay over the events."""
    return store.rr.SegmentationImage(ids.astype(np.uint8), opacity=MASK_OPACITY)


def start_depth(store: Store, entity: str) -> None:
    """Log what holds at all times of a map of depths: the colour of what is not known."""
    classes = [store.rr.AnnotationInfo(0, "known", (0, 0, 0, 0)), store.rr.AnnotationInfo(1, "unknown", RULE)]
    store.log_always(f"{entity}/{UNKNOWN}", store.rr.AnnotationContext(classes))


def log_depth(store: Store, entity: str, depth: Depths, *, t_us: int) -> None:
    """Log a map of depths in thousandths, as PNG: near is bright; what is not known is 0, and grey."""
    known = depth.known & np.isfinite(depth.values)
    thousandths = np.where(known, depth.values * 1000, 0).clip(0, 65535).astype(np.uint16)
    _, png = cv2.imencode(".png", thousandths, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    near, far = (round(1000 * bound) for bound in depth.bounds)
    image = store.rr.EncodedDepthImage(
        blob=png.tobytes(), media_type="image/png", meter=1000.0, depth_range=(far, near), colormap="viridis"
    )
    store.log(entity, image, t_us=t_us)
    unknown = store.rr.SegmentationImage((~known).astype(np.uint8), opacity=1.0)
    store.log(f"{entity}/{UNKNOWN}", unknown, t_us=t_us)


def points_of(
    store: Store, cloud: Cloud, ids: NDArray[np.integer], *, bounds: tuple[float, float], faded: bool = False
) -> Any:
    """Points in the colours of their depths, or of the objects that they belong to."""
    index = depth_index(cloud.points[:, 2], bounds=bounds)
    colours = depth_table()[index.reshape(-1)]
    of_object = ids[cloud.rows, cloud.columns].astype(np.uint8)
    colours[of_object > 0] = id_table()[of_object[of_object > 0]]
    colours = (colours * FADED).astype(np.uint8) if faded else colours
    return store.rr.Points3D(cloud.points, colors=colours, radii=store.rr.Radius.ui_points(POINT_PX))


def arrows_of(store: Store, arrows: Sequence[Arrow], *, unit: str, faded: bool = False) -> Any:
    """The velocities of objects, each with its number and speed."""
    return store.rr.Arrows3D(
        vectors=np.array([one.velocity * ARROW_S for one in arrows]).reshape(-1, 3),
        origins=np.array([one.position for one in arrows]).reshape(-1, 3),
        colors=[_colour(id_colour(one.id), faded=faded) for one in arrows],
        labels=[f"{one.id}: {one.speed:.2f} {unit}" for one in arrows],
        radii=store.rr.Radius.ui_points(2.5),
    )


def start_curves(store: Store, whose: str, *, unit: str, faded: bool = False) -> None:
    """Log the names and colours of the curves of the camera's motion."""
    colour, width = (MUTED, 1.2) if faded else (X_AXIS, 2.2)
    for plot, of in ((TRANSLATION, unit), (ROTATION, "degrees/s")):
        line = store.rr.SeriesLines(colors=[colour], widths=[width], names=[f"{whose}, {of}"])
        store.log_always(f"{plot}/{whose}", line)


def log_curves(store: Store, whose: str, ego: NDArray[np.float64], *, t_us: int) -> None:
    """Log how fast the camera moves and turns; ego (6,) is its twist, NaN where it is not known and the curves stop."""
    known = np.isfinite(ego).all()
    turning = np.degrees(np.linalg.norm(ego[3:]))
    for plot, speed in ((TRANSLATION, np.linalg.norm(ego[:3])), (ROTATION, turning)):
        value = store.rr.Scalars(float(speed)) if known else store.rr.Clear(recursive=False)
        store.log(f"{plot}/{whose}", value, t_us=t_us)


class ObjectCurves:
    """A curve of the speed of each object, which has a name and a colour from its first value on."""

    def __init__(self, whose: str, *, unit: str, faded: bool = False) -> None:
        self._whose, self._unit, self._faded = whose, unit, faded
        self._begun, self._drawn = set[int](), set[int]()

    def log(self, store: Store, arrows: Sequence[Arrow], *, t_us: int) -> None:
        """Log the speeds of one instant; the curve of an object that is gone stops until it is back."""
        drawn = {one.id for one in arrows}
        for gone in self._drawn - drawn:
            store.log(f"{OBJECT_SPEEDS}/{self._whose}/{gone}", store.rr.Clear(recursive=False), t_us=t_us)
        self._drawn = drawn
        for one in arrows:
            entity = f"{OBJECT_SPEEDS}/{self._whose}/{one.id}"
            if one.id not in self._begun:
                self._begun.add(one.id)
                colour, width = _colour(id_colour(one.id), faded=self._faded), 1.2 if self._faded else 2.2
                name = f"{self._whose} {one.id}, {self._unit}"
                store.log_always(entity, store.rr.SeriesLines(colors=[colour], widths=[width], names=[name]))
            store.log(entity, store.rr.Scalars(one.speed), t_us=t_us)


def _colour(colour: RGB, *, faded: bool) -> RGB:
    red, green, blue = (round(value * FADED) for value in colour) if faded else colour
    return red, green, blue
