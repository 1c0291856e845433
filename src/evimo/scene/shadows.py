# pyright: basic
"""What stands in the light: soft shadows of ellipsoids, scalar functions, float32, for both processors.

The light is a disc at infinity. Every part throws the shadow of an ellipsoid about as large; in the space where that is
the unit sphere, the share of the disc that it hides follows from how far the ray to the light passes by its centre.
"""

import math

import numpy as np

from evimo.scene.compiling import lean

f32 = np.float32
_0, _1, _2, _3 = f32(0), f32(1), f32(2), f32(3)
_TINY = f32(1e-9)


@lean
def may_shade(i, point, spread, frame, parts, lamp):
    """Whether part i may stand between the light and points within `spread` of a point in camera axes, m.

    frame: as in `hits.hit_part`. parts: `bodies.Parts`. lamp: angular radius of the light, rad.
    """
    centre, sun = frame[3], frame[4]
    x, y, z = centre[i, 0] - point[0], centre[i, 1] - point[1], centre[i, 2] - point[2]
    along = x * sun[0] + y * sun[1] + z * sun[2]
    reach = f32(1.3) * parts.radius[i] + spread  # an ellipsoid as large as a box reaches further than its corners
    by = reach + lamp * (along + spread)
    return along > -reach and x * x + y * y + z * z - along * along < by * by


@lean
def hidden_share(i, point, frame, parts, lamp):
    """Share of the light that part i hides from a point in camera axes, 0 to 1; arguments as in `may_shade`."""
    to_part, origin, to_light = frame[0], frame[1], frame[2]
    px, py, pz = point
    a, b, c = parts.half[i, 0], parts.half[i, 1], parts.half[i, 2]
    sa, sb, sc = _1 / parts.stout[i, 0], _1 / parts.stout[i, 1], _1 / parts.stout[i, 2]
    x = sa * (to_part[i, 0, 0] * px + to_part[i, 0, 1] * py + to_part[i, 0, 2] * pz + origin[i, 0])
    y = sb * (to_part[i, 1, 0] * px + to_part[i, 1, 1] * py + to_part[i, 1, 2] * pz + origin[i, 1])
    z = sc * (to_part[i, 2, 0] * px + to_part[i, 2, 1] * py + to_part[i, 2, 2] * pz + origin[i, 2])
    lx, ly, lz = sa * to_light[i, 0] / a, sb * to_light[i, 1] / b, sc * to_light[i, 2] / c
    per_m = math.sqrt(lx * lx + ly * ly + lz * lz)
    lx, ly, lz = lx / per_m, ly / per_m, lz / per_m
    ahead = -(x * lx + y * ly + z * lz)  # to where the ray to the light comes nearest to the centre
    if ahead <= _0:
        return _0
    x, y, z = x + ahead * lx, y + ahead * ly, z + ahead * lz
    by = math.sqrt(x * x + y * y + z * z)
    gx, gy, gz = x * sa / a, y * sb / b, z * sc / c
    steep = math.sqrt(gx * gx + gy * gy + gz * gz) / by if by > _TINY else per_m  # of `by`, per metre across the ray
    half_shadow = max(lamp * ahead / per_m * steep, _TINY)
    narrow = min(half_shadow, _1)
    edge = min(_1, max(_0, (_1 + half_shadow - by) / (_2 * narrow)))
    return edge * edge * (_3 - _2 * edge) * (narrow / half_shadow) * (narrow / half_shadow)


@lean
def light_left(found, point, frame, parts, lamp, casters, count):
    """Share of the light that reaches a point of part `found`; bodies throw no shadow on themselves.

    casters, count: the parts that may throw one, and how many of them count. Other arguments as in `may_shade`.
    """
    left = _1
    for k in range(count):
        i = np.uint32(casters[k])
        if parts.body[i] != parts.body[found] and may_shade(i, point, _0, frame, parts, lamp):
            left *= _1 - hidden_share(i, point, frame, parts, lamp)
    return left
