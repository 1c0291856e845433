# pyright: basic
"""Where rays meet triangle meshes: compiled for the CPU, and callable from numba.cuda alike; float32, no stack.

Triangles are tested by sheared edge functions (Woop, Benthin and Wald, "Watertight ray/triangle intersection", 2013),
so that no ray slips between two triangles that share an edge. Boxes are visited front to back without a stack: there
is one order for each octant of ray directions (the idea of Áfra and Szirmay-Kalos, "Stackless multi-BVH traversal",
2014, and of threaded trees before).
"""

import math

import numpy as np

from evimo.scene.rays.compiling import lean

f32 = np.float32
i32 = np.int32

_0, _1 = f32(0), f32(1)
_NEAR, _TINY = f32(1e-3), f32(1e-12)
_WIDER = f32(1.000002)  # a box's far side, so that rounding misses no box


@lean
def _reciprocal(x):
    return _1 / (x if abs(x) > _TINY else (_TINY if x >= _0 else -_TINY))


@lean
def _shear(x, y, z):
    """Axes of a ray's frame, the largest component last, and its shear in the others: kx, ky, kz, sx, sy, sz."""
    ax, ay, az = abs(x), abs(y), abs(z)
    if ax >= ay and ax >= az:
        inverse = _reciprocal(x)
        return 1, 2, 0, y * inverse, z * inverse, inverse
    if ay >= az:
        inverse = _reciprocal(y)
        return 2, 0, 1, z * inverse, x * inverse, inverse
    inverse = _reciprocal(z)
    return 0, 1, 2, x * inverse, y * inverse, inverse


@lean
def _hit_triangle(corners, k, origin, frame):
    """Ray parameter of triangle k, negative where it is missed."""
    ox, oy, oz = origin
    kx, ky, kz, sx, sy, sz = frame
    az, bz, cz = corners[k, kz] - oz, corners[k, 3 + kz] - oz, corners[k, 6 + kz] - oz
    ax, ay = corners[k, kx] - ox - sx * az, corners[k, ky] - oy - sy * az
    bx, by = corners[k, 3 + kx] - ox - sx * bz, corners[k, 3 + ky] - oy - sy * bz
    cx, cy = corners[k, 6 + kx] - ox - sx * cz, corners[k, 6 + ky] - oy - sy * cz
    u, v, w = cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax
    if (u < _0 or v < _0 or w < _0) and (u > _0 or v > _0 or w > _0):
        return -_1
    whole = u + v + w
    if whole == _0:
        return -_1
    return sz * (u * az + v * bz + w * cz) / whole


@lean
def hit_mesh(boxes, nodes, misses, corners, root, ox, oy, oz, x, y, z, nearest):
    """The nearest triangle of one mesh along a ray, in the mesh's unit space.

    Args:
        boxes, nodes, misses, corners: of a `MeshBank`. root: of the mesh, `roots[mesh]`.
        ox, oy, oz: the ray's origin. x, y, z: its direction, not of unit length, as the ray parameter is depth.
        nearest: parameter beyond which nothing counts.

    Returns:
        The ray parameter and the triangle's row in the bank; `nearest` and -1 where nothing is hit before it.
    """
    ix, iy, iz = _reciprocal(x), _reciprocal(y), _reciprocal(z)
    octant = (1 if x < _0 else 0) + (2 if y < _0 else 0) + (4 if z < _0 else 0)
    kx, ky, kz, sx, sy, sz = _shear(x, y, z)
    around = (ox, oy, oz)
    origin = (around[kx], around[ky], around[kz])
    frame = (kx, ky, kz, sx, sy, sz)
    best, found, node = nearest, i32(-1), i32(root)
    while node >= 0:
        ax, bx = (boxes[node, 0] - ox) * ix, (boxes[node, 3] - ox) * ix
        ay, by = (boxes[node, 1] - oy) * iy, (boxes[node, 4] - oy) * iy
        az, bz = (boxes[node, 2] - oz) * iz, (boxes[node, 5] - oz) * iz
        near = max(min(ax, bx), max(min(ay, by), min(az, bz)))
        far = min(max(ax, bx), min(max(ay, by), max(az, bz))) * _WIDER
        if far < near or far < _0 or near > best:
            node = misses[octant, node]
            continue
        count = nodes[node, 1]
        if count == 0:
            node = nodes[node, 2] if (octant >> nodes[node, 3]) & 1 else i32(node + 1)
            continue
        first = nodes[node, 0]
        for k in range(first, first + count):
            t = _hit_triangle(corners, k, origin, frame)
            if t > _NEAR and t < best:
                best, found = t, i32(k)
        node = misses[octant, node]
    return best, found


@lean
def mesh_normal(corners, normals, triangle, hx, hy, hz, x, y, z):
    """Unit normal, towards where the ray x, y, z came from, at a point of a triangle: smooth except at creases.

    Args:
        corners, normals: of a `MeshBank`. triangle: of `hit_mesh`. hx, hy, hz: the point in unit space.

    Returns:
        The normal for light, nx, ny, nz, in unit space; and the axis (0, 1, 2) that the triangle itself faces most.
    """
    k = np.uint32(triangle)
    ax, ay, az = corners[k, 0], corners[k, 1], corners[k, 2]
    ex, ey, ez = corners[k, 3] - ax, corners[k, 4] - ay, corners[k, 5] - az
    fx, fy, fz = corners[k, 6] - ax, corners[k, 7] - ay, corners[k, 8] - az
    gx, gy, gz = ey * fz - ez * fy, ez * fx - ex * fz, ex * fy - ey * fx
    px, py, pz = hx - ax, hy - ay, hz - az
    scale = _1 / max(gx * gx + gy * gy + gz * gz, f32(1e-30))
    b = ((py * fz - pz * fy) * gx + (pz * fx - px * fz) * gy + (px * fy - py * fx) * gz) * scale
    c = ((ey * pz - ez * py) * gx + (ez * px - ex * pz) * gy + (ex * py - ey * px) * gz) * scale
    b = min(_1, max(_0, b))
    c = min(_1 - b, max(_0, c))
    a = _1 - b - c
    nx = a * normals[k, 0] + b * normals[k, 3] + c * normals[k, 6]
    ny = a * normals[k, 1] + b * normals[k, 4] + c * normals[k, 7]
    nz = a * normals[k, 2] + b * normals[k, 5] + c * normals[k, 8]
    sign = _1 if gx * x + gy * y + gz * z <= _0 else -_1
    scale = sign / math.sqrt(max(nx * nx + ny * ny + nz * nz, f32(1e-12)))
    mx, my, mz = abs(gx), abs(gy), abs(gz)
    axis = 0 if mx >= my and mx >= mz else (1 if my >= mz else 2)
    return nx * scale, ny * scale, nz * scale, axis
