# pyright: basic
"""Where a ray meets a part: scalar functions, float32 throughout, for both processors.

A part is met in its unit space, where it reaches from -1 to 1 along each axis. There a ray starts at (ox, oy, oz) and
goes along (x, y, z), which is where the camera's (dx, dy, 1) ends up, so the ray's parameter t stays depth in m. Every
`hit_` function gives the t of its hit, or MISS. They have no branches: a loop over rays becomes vector instructions.
"""

import math

import numpy as np

from evimo.scene.rays.compiling import lean
from evimo.scene.rays.mesh_hits import hit_mesh

f32 = np.float32
i32 = np.int32

NEAR, FAR, MISS = f32(1e-3), f32(1e9), f32(-1)
_0, _1, _TINY = f32(0), f32(1), f32(1e-12)


@lean
def matrix(to_part, i):
    """Matrix i of (P, 3, 3) as nine numbers."""
    m = to_part
    return m[i, 0, 0], m[i, 0, 1], m[i, 0, 2], m[i, 1, 0], m[i, 1, 1], m[i, 1, 2], m[i, 2, 0], m[i, 2, 1], m[i, 2, 2]


@lean
def direction(m, dx, dy):
    """The camera's (dx, dy, 1) in the unit space of a part; m: its matrix (9,)."""
    return m[0] * dx + m[1] * dy + m[2], m[3] * dx + m[4] * dy + m[5], m[6] * dx + m[7] * dy + m[8]


@lean
def _inverse(x):
    return _1 / (x if abs(x) > _TINY else _TINY)


@lean
def hit_box(ox, oy, oz, x, y, z, inside):
    """The cube's near side, or its far side where it is seen from `inside`."""
    ix, iy, iz = _inverse(x), _inverse(y), _inverse(z)
    ax, bx = (-_1 - ox) * ix, (_1 - ox) * ix
    ay, by = (-_1 - oy) * iy, (_1 - oy) * iy
    az, bz = (-_1 - oz) * iz, (_1 - oz) * iz
    near = max(min(ax, bx), max(min(ay, by), min(az, bz)))
    far = min(max(ax, bx), min(max(ay, by), max(az, bz)))
    t = far if inside else near
    return t if far >= near else MISS


@lean
def hit_ellipsoid(ox, oy, oz, x, y, z):
    """The sphere, from outside."""
    a, b = x * x + y * y + z * z, ox * x + oy * y + oz * z
    c = ox * ox + oy * oy + oz * oz - _1
    root = b * b - a * c
    t = (-b - math.sqrt(max(root, _0))) / a
    return t if root >= _0 else MISS


@lean
def hit_cylinder(ox, oy, oz, x, y, z):
    """The cylinder along z, from outside, its ends included."""
    a, b = max(x * x + y * y, _TINY), ox * x + oy * y
    c = ox * ox + oy * oy - _1
    root = b * b - a * c
    side = math.sqrt(max(root, _0))
    iz = _inverse(z)
    za, zb = (-_1 - oz) * iz, (_1 - oz) * iz
    near = max((-b - side) / a, min(za, zb))
    far = min((-b + side) / a, max(za, zb))
    return near if root >= _0 and far >= near else MISS


@lean
def hit_grating(ox, oy, oz, x, y, z, across, down, wide, high):
    """The square net at z = 0: bars per half size across and down, and the share of each pitch that is bar."""
    t = -oz * _inverse(z)
    px, py = ox + t * x, oy + t * y
    u, v = (px + _1) * across, (py + _1) * down
    solid = u - math.floor(u) < wide or v - math.floor(v) < high
    return t if solid and abs(px) <= _1 and abs(py) <= _1 else MISS


@lean
def hit_part(i, dx, dy, nearest, frame, parts, meshes):
    """Depth at which the ray (dx, dy, 1) meets part i, and which triangle of a mesh (else -1).

    The depth is MISS, or not between NEAR and `nearest`, where the part is missed or something nearer is known.

    Args:
        frame: to_part (P, 3, 3), origin (P, 3), light (P, 3), centre (P, 3) and shadows (Q, ROW) of `bodies.Placed` at
            a time.
        parts, meshes: `bodies.Parts` and `MeshBank`.
    """
    to_part, origin = frame[0], frame[1]
    shape, bars = parts.shape[i], parts.openings
    ox, oy, oz = origin[i, 0], origin[i, 1], origin[i, 2]
    x, y, z = direction(matrix(to_part, i), dx, dy)
    if shape == 0:
        return hit_box(ox, oy, oz, x, y, z, parts.inside[i] != 0), i32(-1)
    if shape == 1:
        return hit_ellipsoid(ox, oy, oz, x, y, z), i32(-1)
    if shape == 2:
        return hit_cylinder(ox, oy, oz, x, y, z), i32(-1)
    if shape == 3:
        return hit_grating(ox, oy, oz, x, y, z, bars[i, 0], bars[i, 1], bars[i, 2], bars[i, 3]), i32(-1)
    return hit_mesh_part(i, ox, oy, oz, x, y, z, nearest, parts, meshes)


@lean
def hit_mesh_part(i, ox, oy, oz, x, y, z, nearest, parts, meshes):
    """Parameter and triangle of the part's mesh."""
    root = meshes.roots[parts.mesh[i]]
    return hit_mesh(meshes.boxes, meshes.nodes, meshes.misses, meshes.corners, root, ox, oy, oz, x, y, z, nearest)
