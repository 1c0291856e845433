# pyright: basic
"""CUDA kernels that film a moving scene: the functions of the CPU, one thread per pixel and frame.

Every tile is cast in every frame, as on the CPU with strides of 1: first the centres, then more rays at edges.
"""

from typing import Any, NamedTuple

import numpy as np

from evimo.scene.rays.film import TILE, bounding_spheres, parts_in_sight
from evimo.scene.rays.hits import FAR, NEAR, hit_part
from evimo.scene.rays.on_device import cuda, on_device
from evimo.scene.rays.shading import NOTHING, SKY, shade_ray
from evimo.scene.rays.shadows import hidden_share
from evimo.scene.rays.tiles import moment

f32 = np.float32
i32 = np.int32
_0, _1, _NONE = f32(0), f32(1), i32(-1)
LISTING = (8, 8, 2)  # tiles across, tiles down and frames that a block makes lists for

_hit_part, _shade_ray, _moment = on_device(hit_part), on_device(shade_ray), on_device(moment)
_hidden_share = on_device(hidden_share)
_spheres, _listing = on_device(bounding_spheres), on_device(parts_in_sight)


class Lists(NamedTuple):
    """The parts that each tile may see at each frame.

    parts: (R, C, F, P) uint8, counts: (R, C, F) how many of them count, nets: (R, C, F) whether one is a fine net.
    """

    parts: Any
    counts: Any
    nets: Any


@cuda.jit
def bound(centre, parts, light, spheres):
    """What tiles ask of each part at each frame."""
    f = cuda.grid(1)
    if f < spheres.shape[0]:
        _spheres(centre[f], parts, light[1], spheres[f])


@cuda.jit
def fill_lists(cones, spheres, lists):
    """The parts of each tile at each frame."""
    column, row, f = cuda.grid(3)
    if row < cones.shape[0] and column < cones.shape[1] and f < spheres.shape[0]:
        count, net = _listing(cones[row, column], spheres[f], lists.parts[row, column, f])
        lists.counts[row, column, f], lists.nets[row, column, f] = count, net


@cuda.jit(device=True)
def _nearest(dx, dy, frame, things, listed, count):
    """Depth, part and triangle of what the ray (dx, dy, 1) meets first, as in `tiles.trace`."""
    depth, found, met = FAR, _NONE, _NONE
    for c in range(count):
        t, triangle = _hit_part(listed[c], dx, dy, depth, frame, things[0], things[2])
        if t > NEAR and t < depth:
            depth, found, met = t, i32(listed[c]), triangle
    return depth, found, met


@cuda.jit(device=True)
def _light_left(t, dx, dy, body, rows, parts):
    """Share of the directed light that reaches depth t of a ray (dx, dy, 1), as in `tiles.shade`."""
    left = _1
    for c in range(len(parts.casters)):
        if parts.body[parts.casters[c]] != body:
            left *= _1 - _hidden_share(rows[c], t * dx, t * dy, t)
    return left


@cuda.jit(device=True)
def _look(dx, dy, frame, things, light, listed, count):
    """Depth, irradiance and tag of what the ray (dx, dy, 1) meets first."""
    hit = _nearest(dx, dy, frame, things, listed, count)
    if hit[1] < 0:
        return hit[0], SKY, i32(NOTHING)
    left = _light_left(hit[0], dx, dy, things[0].body[hit[1]], frame[4], things[0])
    irradiance, tag = _shade_ray(dx, dy, hit, frame, things, light, left)
    return hit[0], irradiance, tag


@cuda.jit
def cast_centres(rays, placed, things, light, lists, image, depth, tags):
    """The centre rays of all pixels of all frames; a block is a tile."""
    column, row, f = cuda.blockIdx.x, cuda.blockIdx.y, cuda.blockIdx.z
    x, y = column * TILE + cuda.threadIdx.x, row * TILE + cuda.threadIdx.y
    if y < image.shape[1] and x < image.shape[2]:
        frame = _moment(placed, f)
        listed, count = lists.parts[row, column, f], lists.counts[row, column, f]
        far, seen, tag = _look(rays[0, 0, y, x], rays[0, 1, y, x], frame, things, light, listed, count)
        depth[f, y, x], image[f, y, x], tags[f, y, x] = far, seen, tag


@cuda.jit
def smooth_edges(rays, placed, things, light, lists, image, tags):
    """More rays in pixels that see another face than a neighbour, or a fine net."""
    column, row, f = cuda.blockIdx.x, cuda.blockIdx.y, cuda.blockIdx.z
    x, y = column * TILE + cuda.threadIdx.x, row * TILE + cuda.threadIdx.y
    height, width = image.shape[1], image.shape[2]
    if y < height and x < width:
        tag, up, down = tags[f, y, x], max(y - 1, 0), min(y + 1, height - 1)
        edge = tags[f, y, max(x - 1, 0)] != tag or tags[f, y, min(x + 1, width - 1)] != tag
        if edge or tags[f, up, x] != tag or tags[f, down, x] != tag or lists.nets[row, column, f]:
            frame = _moment(placed, f)
            listed, count = lists.parts[row, column, f], lists.counts[row, column, f]
            total = _0
            for s in range(1, rays.shape[0]):
                _, seen, _ = _look(rays[s, 0, y, x], rays[s, 1, y, x], frame, things, light, listed, count)
                total += seen
            image[f, y, x] = total / f32(rays.shape[0] - 1)
