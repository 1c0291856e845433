# pyright: basic
"""The ray caster's compiled kernels: float32 throughout, one tile of pixels at a time.

Each primitive meets all rays of a tile in one loop without branches, which the compiler turns into vector instructions.
numba promotes float32 with a bare float literal to float64, so constants are float32 by name.
"""

import math

import numba
import numpy as np

f32 = np.float32
i32 = np.int32

_0, _HALF, _1 = f32(0), f32(0.5), f32(1)
_NEAR, _FAR, _TINY = f32(1e-3), f32(1e9), f32(1e-12)
_MISS = f32(-1)

jit = numba.njit(nogil=True, error_model="numpy", cache=True)


@jit
def _inverse(x):
    return _1 / (x if abs(x) > _TINY else _TINY)


@jit
def _local(m, o, i, dx, dy):
    """A ray in the unit space of part i: its origin is o[i], this is its direction."""
    return (
        m[i, 0, 0] * dx + m[i, 0, 1] * dy + m[i, 0, 2],
        m[i, 1, 0] * dx + m[i, 1, 1] * dy + m[i, 1, 2],
        m[i, 2, 0] * dx + m[i, 2, 1] * dy + m[i, 2, 2],
    )


@jit
def _keep(t, i, k, depth, found):
    nearer = t > _NEAR and t < depth[k]
    depth[k] = t if nearer else depth[k]
    found[k] = i if nearer else found[k]


@jit
def _boxes(rays, number, i, m, o, inside, depth, found):
    ox, oy, oz = o[i, 0], o[i, 1], o[i, 2]
    for k in range(number):
        x, y, z = _local(m, o, i, rays[0, k], rays[1, k])
        ix, iy, iz = _inverse(x), _inverse(y), _inverse(z)
        ax, bx = (-_1 - ox) * ix, (_1 - ox) * ix
        ay, by = (-_1 - oy) * iy, (_1 - oy) * iy
        az, bz = (-_1 - oz) * iz, (_1 - oz) * iz
        near = max(min(ax, bx), max(min(ay, by), min(az, bz)))
        far = min(max(ax, bx), min(max(ay, by), max(az, bz)))
        t = far if inside else near
        _keep(t if far >= near else _MISS, i, k, depth, found)


@jit
def _ellipsoids(rays, number, i, m, o, depth, found):
    ox, oy, oz = o[i, 0], o[i, 1], o[i, 2]
    c = ox * ox + oy * oy + oz * oz - _1
    for k in range(number):
        x, y, z = _local(m, o, i, rays[0, k], rays[1, k])
        a, b = x * x + y * y + z * z, ox * x + oy * y + oz * z
        root = b * b - a * c
        t = (-b - math.sqrt(max(root, _0))) / a
        _keep(t if root >= _0 else _MISS, i, k, depth, found)


@jit
def _cylinders(rays, number, i, m, o, depth, found):
    ox, oy, oz = o[i, 0], o[i, 1], o[i, 2]
    c = ox * ox + oy * oy - _1
    for k in range(number):
        x, y, z = _local(m, o, i, rays[0, k], rays[1, k])
        a, b = max(x * x + y * y, _TINY), ox * x + oy * y
        root = b * b - a * c
        side = math.sqrt(max(root, _0))
        iz = _inverse(z)
        za, zb = (-_1 - oz) * iz, (_1 - oz) * iz
        near = max((-b - side) / a, min(za, zb))
        far = min((-b + side) / a, max(za, zb))
        _keep(near if root >= _0 and far >= near else _MISS, i, k, depth, found)


@jit
def _gratings(rays, number, i, m, o, bars, depth, found):
    ox, oy, oz = o[i, 0], o[i, 1], o[i, 2]
    across, down, wide, high = bars[i, 0], bars[i, 1], bars[i, 2], bars[i, 3]
    for k in range(number):
        x, y, z = _local(m, o, i, rays[0, k], rays[1, k])
        t = -oz * _inverse(z)
        px, py = ox + t * x, oy + t * y
        u, v = (px + _1) * across, (py + _1) * down
        solid = u - math.floor(u) < wide or v - math.floor(v) < high
        _keep(t if solid and abs(px) <= _1 and abs(py) <= _1 else _MISS, i, k, depth, found)


@jit
def trace(rays, number, frame, parts, listed, count, depth, found):
    """The nearest of the listed parts along rays (x, y, 1).

    Args:
        rays: (2, N) x and y on Z = 1, of which the first `number` count. frame: to_part (P, 3, 3), origin (P, 3).
        listed, count: indices of parts to try. depth, found: (N,) written: z in m and part, negative where nothing.
    """
    to_part, origin = frame
    for k in range(number):
        depth[k], found[k] = _FAR, i32(-1)
    for c in range(count):
        i = listed[c]
        shape = parts.shape[i]
        if shape == 0:
            _boxes(rays, number, i, to_part, origin, parts.inside[i] != 0, depth, found)
        elif shape == 1:
            _ellipsoids(rays, number, i, to_part, origin, depth, found)
        elif shape == 2:
            _cylinders(rays, number, i, to_part, origin, depth, found)
        else:
            _gratings(rays, number, i, to_part, origin, parts.openings, depth, found)


@jit
def cast(rays, placed, parts):
    """Depth (F, N) and part index (F, N), negative where nothing, of rays (2, N) on Z = 1, against every part."""
    frames, number = placed.to_part.shape[0], rays.shape[1]
    depth, found = np.empty((frames, number), np.float32), np.empty((frames, number), np.int32)
    everything = np.arange(len(parts.shape)).astype(np.int32)
    for f in range(frames):
        frame = placed.to_part[f], placed.origin[f]
        trace(rays, number, frame, parts, everything, len(everything), depth[f], found[f])
    return depth, found
