# pyright: basic
"""Many rays at a time on the CPU: the nearest parts they meet, and what they see there.

Each part meets all rays of a tile in one loop without branches, which the compiler turns into vector instructions.
"""

import math

import numpy as np

from evimo.scene.compiling import jit, lean
from evimo.scene.hits import (
    FAR,
    MISS,
    NEAR,
    direction,
    hit_box,
    hit_cylinder,
    hit_ellipsoid,
    hit_grating,
    hit_mesh_part,
)
from evimo.scene.shading import NOTHING, SKY, shade_ray
from evimo.scene.shadows import may_shade

i32 = np.int32
_HALF = np.float32(0.5)


@lean
def _keep(t, i, k, depth, found):
    nearer = t > NEAR and t < depth[k]
    depth[k] = t if nearer else depth[k]
    found[k] = i if nearer else found[k]


@lean
def _boxes(rays, number, i, to_part, origin, inside, depth, found):
    ox, oy, oz = origin[i, 0], origin[i, 1], origin[i, 2]
    for k in range(number):
        x, y, z = direction(to_part, i, rays[0, k], rays[1, k])
        _keep(hit_box(ox, oy, oz, x, y, z, inside), i, k, depth, found)


@lean
def _ellipsoids(rays, number, i, to_part, origin, depth, found):
    ox, oy, oz = origin[i, 0], origin[i, 1], origin[i, 2]
    for k in range(number):
        x, y, z = direction(to_part, i, rays[0, k], rays[1, k])
        _keep(hit_ellipsoid(ox, oy, oz, x, y, z), i, k, depth, found)


@lean
def _cylinders(rays, number, i, to_part, origin, depth, found):
    ox, oy, oz = origin[i, 0], origin[i, 1], origin[i, 2]
    for k in range(number):
        x, y, z = direction(to_part, i, rays[0, k], rays[1, k])
        _keep(hit_cylinder(ox, oy, oz, x, y, z), i, k, depth, found)


@lean
def _gratings(rays, number, i, to_part, origin, bars, depth, found):
    ox, oy, oz = origin[i, 0], origin[i, 1], origin[i, 2]
    across, down, wide, high = bars[i, 0], bars[i, 1], bars[i, 2], bars[i, 3]
    for k in range(number):
        x, y, z = direction(to_part, i, rays[0, k], rays[1, k])
        _keep(hit_grating(ox, oy, oz, x, y, z, across, down, wide, high), i, k, depth, found)


@lean
def _meshes(rays, number, i, frame, parts, meshes, hits):
    depth, found, met = hits
    to_part, origin = frame[0], frame[1]
    ox, oy, oz = origin[i, 0], origin[i, 1], origin[i, 2]
    for k in range(number):
        x, y, z = direction(to_part, i, rays[0, k], rays[1, k])
        t, triangle = hit_mesh_part(i, ox, oy, oz, x, y, z, depth[k], parts, meshes)
        if triangle >= 0:
            depth[k], found[k], met[k] = t, i, triangle


@lean
def trace(rays, number, frame, things, lists, hits):
    """The nearest of the listed parts along rays (x, y, 1).

    Args:
        rays: (2, N) x and y on Z = 1, of which the first `number` count. frame, things: as in `shading.shade_ray`.
        lists: indices of parts to try, and how many of them count.
        hits: depth, part and triangle (N,), written: part negative where nothing, triangle where the part is a mesh.
    """
    (parts, _, meshes), (depth, found, _) = things, hits
    to_part, origin = frame[0], frame[1]
    for k in range(number):
        depth[k], found[k] = FAR, i32(-1)
    for c in range(lists[1]):
        i = lists[0][c]
        shape = parts.shape[i]
        if shape == 0:
            _boxes(rays, number, i, to_part, origin, parts.inside[i] != 0, depth, found)
        elif shape == 1:
            _ellipsoids(rays, number, i, to_part, origin, depth, found)
        elif shape == 2:
            _cylinders(rays, number, i, to_part, origin, depth, found)
        elif shape == 3:
            _gratings(rays, number, i, to_part, origin, parts.openings, depth, found)
        else:
            _meshes(rays, number, i, frame, parts, meshes, hits)


@lean
def _casters(rays, number, hits, frame, parts, lamp, listed):
    """The parts that may stand in the light of what the rays meet; returns how many were listed."""
    depth, found = hits[0], hits[1]
    x0, y0, z0, x1, y1, z1 = FAR, FAR, FAR, -FAR, -FAR, -FAR
    for k in range(number):
        z = depth[k] if found[k] >= 0 else MISS
        x, y = z * rays[0, k], z * rays[1, k]
        x0, x1, y0, y1 = min(x0, x), max(x1, x), min(y0, y), max(y1, y)
        z0, z1 = min(z0, z), max(z1, z)
    middle = _HALF * (x0 + x1), _HALF * (y0 + y1), _HALF * (z0 + z1)
    x, y, z = x1 - x0, y1 - y0, z1 - z0
    spread, count = _HALF * math.sqrt(x * x + y * y + z * z), 0
    for i in parts.casters:
        if may_shade(i, middle, spread, frame, parts, lamp):
            listed[count] = i
            count += 1
    return count


@lean
def shade(rays, number, hits, frame, things, light, listed, seen):
    """What rays (x, y, 1) see.

    Args:
        rays, number, hits: of `trace`. frame, things, light: as in `shading.shade_ray`.
        listed: (P,) scratch. seen: irradiance and tag (N,), written.
    """
    (depth, found, met), (irradiance, tags) = hits, seen
    count = _casters(rays, number, hits, frame, things[0], light[2], listed) if len(things[0].casters) > 0 else 0
    for k in range(number):
        irradiance[k], tags[k] = SKY, NOTHING
        if found[k] >= 0:
            hit = depth[k], found[k], met[k]
            irradiance[k], tags[k] = shade_ray(rays[0, k], rays[1, k], hit, frame, things, light, (listed, count))


@lean
def moment(placed, f):
    """Frame f of `bodies.Placed`, for lean callers: nobody counts these references."""
    return placed.to_part[f], placed.origin[f], placed.light[f], placed.centre[f], placed.sun[f]


@lean
def _cast(rays, placed, things, lists, hits):
    depth, found, met = hits
    for f in range(len(depth)):
        trace(rays, rays.shape[1], moment(placed, f), things, lists, (depth[f], found[f], met))


@jit
def cast(rays, placed, things):
    """Depth (F, N) and part index (F, N), negative where nothing, of rays (2, N) on Z = 1, against every part."""
    frames, number, parts = placed.to_part.shape[0], rays.shape[1], len(things[0].shape)
    depth, found = np.empty((frames, number), np.float32), np.empty((frames, number), np.int32)
    met, everything = np.empty(number, np.int32), np.arange(parts).astype(np.int32)
    _cast(rays, placed, things, (everything, parts), (depth, found, met))
    return depth, found
