# pyright: basic
"""Many rays at a time on the CPU: the nearest parts they meet, and what they see there.

Each part meets all rays of a tile in one loop without branches, which the compiler turns into vector instructions.
"""

import numpy as np

from evimo.scene.rays.compiling import inlined, jit, lean
from evimo.scene.rays.hits import (
    FAR,
    NEAR,
    direction,
    hit_box,
    hit_cylinder,
    hit_ellipsoid,
    hit_grating,
    hit_mesh_part,
    matrix,
)
from evimo.scene.rays.shading import NOTHING, SKY, lit, part_row, pattern
from evimo.scene.rays.shadows import hidden_share, may_shade

i32 = np.int32
NONE = np.int64(0)  # counters start there: numba compiles what a literal 0 is passed to once more
MOST = 1024  # rays at a time
STRIDE = MOST + 16  # of the rows of scratch, float32: odd in cache lines
ROWS = 11
_DX, _DY, _T, _LEFT, _U, _V, _FINE, _SHARE, _BRIGHT, _SHINE, _FACE = range(0, ROWS * STRIDE, STRIDE)
_0, _HALF, _1 = np.float32(0), np.float32(0.5), np.float32(1)


@lean
def _keep(t, i, k, depth, found):
    nearer = t > NEAR and t < depth[k]
    depth[k] = t if nearer else depth[k]
    found[k] = i if nearer else found[k]


@lean
def _boxes(rays, number, i, to_part, origin, inside, depth, found):
    m, ox, oy, oz = matrix(to_part, i), origin[i, 0], origin[i, 1], origin[i, 2]
    for k in range(number):
        x, y, z = direction(m, rays[0, k], rays[1, k])
        _keep(hit_box(ox, oy, oz, x, y, z, inside), i, k, depth, found)


@lean
def _ellipsoids(rays, number, i, to_part, origin, depth, found):
    m, ox, oy, oz = matrix(to_part, i), origin[i, 0], origin[i, 1], origin[i, 2]
    for k in range(number):
        x, y, z = direction(m, rays[0, k], rays[1, k])
        _keep(hit_ellipsoid(ox, oy, oz, x, y, z), i, k, depth, found)


@lean
def _cylinders(rays, number, i, to_part, origin, depth, found):
    m, ox, oy, oz = matrix(to_part, i), origin[i, 0], origin[i, 1], origin[i, 2]
    for k in range(number):
        x, y, z = direction(m, rays[0, k], rays[1, k])
        _keep(hit_cylinder(ox, oy, oz, x, y, z), i, k, depth, found)


@lean
def _gratings(rays, number, i, to_part, origin, bars, depth, found):
    m, ox, oy, oz = matrix(to_part, i), origin[i, 0], origin[i, 1], origin[i, 2]
    across, down, wide, high = bars[i, 0], bars[i, 1], bars[i, 2], bars[i, 3]
    for k in range(number):
        x, y, z = direction(m, rays[0, k], rays[1, k])
        _keep(hit_grating(ox, oy, oz, x, y, z, across, down, wide, high), i, k, depth, found)


@lean
def _meshes(rays, number, i, frame, parts, meshes, hits):
    depth, found, met = hits
    to_part, origin = frame[0], frame[1]
    m, ox, oy, oz = matrix(to_part, i), origin[i, 0], origin[i, 1], origin[i, 2]
    for k in range(number):
        x, y, z = direction(m, rays[0, k], rays[1, k])
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
def _casters(rays, number, hits, frame, parts, listed, owner):
    """The casters that may stand in the light of what the rays meet; returns how many were listed.

    owner: (N,) body that each ray meets, written. Bodies throw no shadow on themselves.
    """
    depth, found, _ = hits
    x0, y0, z0, x1, y1, z1 = FAR, FAR, FAR, -FAR, -FAR, -FAR
    only, several = i32(-1), False
    for k in range(number):
        met, z = found[k] >= 0, depth[k]
        x, y = z * rays[0, k], z * rays[1, k]
        owner[k] = parts.body[found[k]] if met else i32(-1)
        if met:
            x0, x1, y0, y1 = min(x0, x), max(x1, x), min(y0, y), max(y1, y)
            z0, z1 = min(z0, z), max(z1, z)
            several = several or (only >= 0 and only != owner[k])
            only = owner[k]
    if only < 0:
        return 0
    middle = _HALF * (x0 + x1), _HALF * (y0 + y1), _HALF * (z0 + z1)
    half, count = (_HALF * (x1 - x0), _HALF * (y1 - y0), _HALF * (z1 - z0)), 0
    for c in range(len(parts.casters)):
        if may_shade(frame[4][c], middle, half) and (several or parts.body[parts.casters[c]] != only):
            listed[count] = c
            count += 1
    return count


@lean
def _darken(rays, number, depth, row, body, owner, left):
    """Take from each ray's end the share of the light that a caster hides."""
    for k in range(number):
        z = depth[k]
        share = hidden_share(row, z * rays[0, k], z * rays[1, k], z)
        left[k] *= _1 - (share if owner[k] != body else _0)


@inlined
def _surfaces(shape, number, row, light, work, met):
    """The ends of the first rays of `work` on one part; met: meshes, and each ray's triangle and place there."""
    meshes, triangles, order = met
    for k in range(number):
        ray, hit = (work[_DX + k], work[_DY + k]), (work[_T + k], work[_LEFT + k])
        triangle = triangles[order[k]] if shape == 4 else i32(0)
        u, v, fine, share, bright, shine, face = lit(shape, ray, hit, row, light, (meshes, triangle))
        work[_U + k], work[_V + k], work[_FINE + k], work[_SHARE + k] = u, v, fine, share
        work[_BRIGHT + k], work[_SHINE + k], work[_FACE + k] = bright, shine, face


@lean
def _shade_part(i, number, frame, things, light, work, order, triangles, seen):
    """What the first rays of `work` see, which all end on part i; `order` says which rays they are."""
    (parts, bank, meshes), (irradiance, tags) = things, seen
    row, around, shape = part_row(i, frame, parts), (light[0], light[1]), parts.shape[i]
    met = meshes, triangles, order
    if shape == 0:
        _surfaces(0, number, row, around, work, met)
    elif shape == 1:
        _surfaces(1, number, row, around, work, met)
    elif shape == 2:
        _surfaces(2, number, row, around, work, met)
    elif shape == 3:
        _surfaces(3, number, row, around, work, met)
    else:
        _surfaces(4, number, row, around, work, met)
    dark, bright, texture = parts.reflectance[i, 0], parts.reflectance[i, 1], parts.texture[i]
    for k in range(number):
        u, v, fine, share = work[_U + k], work[_V + k], i32(work[_FINE + k]), work[_SHARE + k]
        reflectance = dark + (bright - dark) * pattern(bank.texels, bank.offsets, texture, u, v, fine, share)
        irradiance[order[k]] = reflectance * work[_BRIGHT + k] + work[_SHINE + k]
        tags[order[k]] = i32(i) * i32(8) + i32(work[_FACE + k])


@lean
def shade(rays, number, hits, frame, things, light, scratch, seen):
    """What rays (x, y, 1) see.

    Args:
        rays, number, hits: of `trace`. frame, things, light: as in `shading.shade_ray`.
        scratch: of `film`. seen: irradiance and tag (N,), written.
    """
    (depth, found, met), (irradiance, tags), (listed, owner, left, order, work) = hits, seen, scratch
    parts, count = things[0], NONE
    for k in range(number):
        left[k], irradiance[k], tags[k] = _1, SKY, NOTHING
    if len(parts.casters) > 0:
        count = _casters(rays, number, hits, frame, parts, listed, owner)
    for k in range(count):
        c = listed[k]
        _darken(rays, number, depth, frame[4][c], parts.body[parts.casters[c]], owner, left)
    for first in range(number):
        if found[first] < 0 or tags[first] >= 0:
            continue
        i, mine = found[first], NONE
        for k in range(first, number):
            if found[k] == i:
                order[mine], work[_DX + mine], work[_DY + mine] = k, rays[0, k], rays[1, k]
                work[_T + mine], work[_LEFT + mine] = depth[k], left[k]
                mine += 1
        _shade_part(np.uint32(i), mine, frame, things, light, work, order, met, seen)


@lean
def moment(placed, f):
    """Frame f of `bodies.Placed`, for lean callers: nobody counts these references."""
    return placed.to_part[f], placed.origin[f], placed.light[f], placed.centre[f], placed.shadows[f]


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
