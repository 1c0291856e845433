# pyright: basic
"""The events near an object, brought to the rectified image in one compiled pass."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evimo.compiling import njit
from evimo.events.events import Events
from evimo.geometry.rectification import Rectification
from evimo.recordings.estimate import Estimate

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]


class Nearby(NamedTuple):
    """Events near an object, in its box and in its window of time.

    x, y:   px in the box, (N,) float32.
    t:      slices about the centre of the reference slice, (N,) float32.
    static: (2, N) float32, where each was at that centre if it belongs to the static world.
    index:  which event of those given it is, (N,) int64.
    """

    x: F4
    y: F4
    t: F4
    static: F4
    index: NDArray[np.int64]


class World(NamedTuple):
    """How the static world moves in the rectified image, in one slice.

    x, y, valid: of the rectification, (H, W).
    rel_depth:   of the estimate, (H, W).
    ego:         (6,) of the estimate.
    lens:        fx, fy, cx, cy of the rectified image, (4,).
    t_us, slice_us: the centre and the length of the slice.
    """

    x: F4
    y: F4
    valid: NDArray[np.bool_]
    rel_depth: F4
    ego: F8
    lens: F8
    t_us: int
    slice_us: int


def world_of(estimate: Estimate, rectification: Rectification) -> World:
    """The static world as an estimate knows it."""
    image = rectification.image
    lens = np.array((image.fx, image.fy, image.cx, image.cy))
    maps = rectification.x, rectification.y, rectification.valid, estimate.rel_depth
    return World(*maps, estimate.ego, lens, estimate.t_us, estimate.stop_us - estimate.start_us)


def events_near(events: Events, world: World, *, box: tuple[int, int, int, int], reach: float) -> Nearby:
    """The events in a box (left, top, right, bottom) of the rectified image, up to `reach` slices about the centre."""
    first, last = np.searchsorted(events.t, world.t_us + np.array((-reach, reach)) * world.slice_us).tolist()
    part = events.part(first, last)
    return _near(part.x, part.y, part.t, world, box, first)


@njit(nogil=True)
def _near(columns, rows, times, world, box, first):
    count, left, top = 0, np.float32(box[0]), np.float32(box[1])
    x, y, t = np.empty(len(times), np.float32), np.empty(len(times), np.float32), np.empty(len(times), np.float32)
    static, index = np.empty((2, len(times)), np.float32), np.empty(len(times), np.int64)
    for k in range(len(times)):
        row, column = rows[k], columns[k]
        if not world.valid[row, column]:
            continue
        at_x, at_y = world.x[row, column], world.y[row, column]
        if not (box[0] <= at_x < box[2] and box[1] <= at_y < box[3]):
            continue
        u, v = static_flow(at_x, at_y, world.rel_depth[row, column], world.ego, world.lens)
        elapsed = (times[k] - world.t_us) * 1e-6
        x[count], y[count], index[count] = at_x - left, at_y - top, first + k
        t[count] = elapsed * 1e6 / world.slice_us
        static[0, count], static[1, count] = at_x - left - elapsed * u, at_y - top - elapsed * v
        count += 1
    return Nearby(x[:count], y[:count], t[:count], static[:, :count], index[:count])


@njit(nogil=True)
def static_flow(at_x, at_y, depth, ego, lens):
    """Image velocity (u, v) in px/s of a static point at (at_x, at_y) px: the compiled twin of `motion_field`."""
    x, y = (at_x - lens[2]) / lens[0], (at_y - lens[3]) / lens[1]
    inv_z = 1 / max(depth, 1e-3)
    u = inv_z * (x * ego[2] - ego[0]) + x * y * ego[3] - (1 + x * x) * ego[4] + y * ego[5]
    v = inv_z * (y * ego[2] - ego[1]) + (1 + y * y) * ego[3] - x * y * ego[4] - x * ego[5]
    return u * lens[0], v * lens[1]
