# pyright: basic
"""What a ray sees where it ends: texture, light, and which face; scalar functions, float32, for both processors."""

import math

import numpy as np

from evimo.scene.compiling import lean
from evimo.scene.hits import direction

f32 = np.float32
i32 = np.int32
TEXTURE = 256
TEXTURE_LEVELS = 7

_0, _HALF, _1, _3 = f32(0), f32(0.5), f32(1), f32(3)
SKY = f32(0.3)
NOTHING = -8  # tag of a ray that meets nothing
_CAP = f32(0.9999)  # beyond it along a cylinder's axis a hit is on an end
_GRAZING = f32(0.04)  # least cosine of incidence for the texture's footprint
_COARSEST = f32(TEXTURE_LEVELS - 0.001)
_SIDES = (f32(3.1), f32(5.7), f32(7.3))  # shifts that keep opposite faces of a box from looking alike


@lean
def _texel(texels, base, size, u, v):
    """Bilinear look-up that wraps around."""
    x, y = u * f32(size) - _HALF, v * f32(size) - _HALF
    column, row = i32(x), i32(y)
    column, row = i32(column - (x < f32(column))), i32(row - (y < f32(row)))  # floor, without a call
    fx, fy = x - f32(column), y - f32(row)
    last = i32(size - 1)
    left, right = column & last, (column + 1) & last
    upper, lower = base + (row & last) * size, base + ((row + 1) & last) * size
    a, b = texels[np.uint32(upper + left)], texels[np.uint32(upper + right)]
    c, d = texels[np.uint32(lower + left)], texels[np.uint32(lower + right)]
    top, bottom = a + (b - a) * fx, c + (d - c) * fx
    return top + (bottom - top) * fy


@lean
def _surface_point(shape, hx, hy, hz, a, b, c):
    """Normal (not unit, metric), texture coordinates in m, and face of a hit in unit space."""
    if shape == 0:
        mx, my, mz = abs(hx), abs(hy), abs(hz)
        if mx >= my and mx >= mz:
            n = _1 if hx > _0 else -_1
            return n, _0, _0, hy * b, hz * c + _SIDES[2] * n, 1 if hx > _0 else 2
        if my >= mz:
            n = _1 if hy > _0 else -_1
            return _0, n, _0, hx * a + _SIDES[0] * n, hz * c, 3 if hy > _0 else 4
        n = _1 if hz > _0 else -_1
        return _0, _0, n, hx * a, hy * b + _SIDES[1] * n, 5 if hz > _0 else 6
    if shape == 1:
        radius = (a + b + c) / _3
        v = math.asin(min(_1, max(-_1, hz))) * radius
        return hx / a, hy / b, hz / c, math.atan2(hy, hx) * radius, v, 0
    if shape == 2 and abs(hz) <= _CAP:
        return hx / a, hy / b, _0, math.atan2(hy, hx) * _HALF * (a + b), hz * c, 0
    return _0, _0, (_1 if hz > _0 else -_1), hx * a, hy * b, 1


@lean
def _pattern(texels, offsets, number, footprint, u, v):
    """Texture `number` at u, v in periods, averaged over a footprint given in texels of the finest level."""
    if footprint <= _1:
        return _texel(texels, number * TEXTURE * TEXTURE, TEXTURE, u, v)
    level = min(math.log2(footprint), _COARSEST)
    fine = i32(level)
    size, coarser = i32(TEXTURE) >> fine, i32(TEXTURE // 2) >> fine
    near = _texel(texels, i32(offsets[fine]) + number * size * size, size, u, v)
    far = _texel(texels, i32(offsets[fine + 1]) + number * coarser * coarser, coarser, u, v)
    return near + (far - near) * (level - f32(fine))


@lean
def shade_ray(dx, dy, t, found, triangle, frame, parts, bank, light):
    """Irradiance and tag of the ray (dx, dy, 1) that ends at depth t on part `found`; a tag is part * 8 + face.

    Args:
        triangle: of a mesh. frame: to_part (P, 3, 3), origin (P, 3) and direction to the light (P, 3) of every part at
            this time. parts, bank: `bodies.Parts`, `textures.TextureBank`.
        light: (2,) share of light without direction; size of a pixel on Z = 1.
    """
    to_part, origin, to_light = frame
    shapes, insides, textures, halves = parts.shape, parts.inside, parts.texture, parts.half
    periods, shifts, reflectances = parts.period, parts.shift, parts.reflectance
    texels, offsets = bank.texels, bank.offsets
    i, ambient, pixel = np.uint32(found), light[0], light[1]  # unsigned: no test for counting from the end
    x, y, z = direction(to_part, i, dx, dy)
    hx, hy, hz = origin[i, 0] + t * x, origin[i, 1] + t * y, origin[i, 2] + t * z
    hz = -z if shapes[i] == 3 else hz  # a net has no inside: it is lit on the side that is seen
    a, b, c = halves[i, 0], halves[i, 1], halves[i, 2]
    nx, ny, nz, u, v, face = _surface_point(shapes[i], hx, hy, hz, a, b, c)
    scale = _1 / math.sqrt(nx * nx + ny * ny + nz * nz)
    lambert = scale * (nx * to_light[i, 0] + ny * to_light[i, 1] + nz * to_light[i, 2])
    lambert = -lambert if insides[i] != 0 else lambert
    ex, ey, ez = x * a, y * b, z * c
    cosine = scale * abs(nx * ex + ny * ey + nz * ez) / math.sqrt(ex * ex + ey * ey + ez * ez)
    per_m = _1 / periods[i]
    footprint = t * pixel * f32(TEXTURE) * per_m / math.sqrt(max(cosine, _GRAZING))
    u, v = u * per_m + shifts[i, 0], v * per_m + shifts[i, 1]
    pattern = _pattern(texels, offsets, textures[i], footprint, u, v)
    dark, bright = reflectances[i, 0], reflectances[i, 1]
    lit = ambient + (_1 - ambient) * (_HALF + _HALF * lambert)
    return (dark + (bright - dark) * pattern) * lit, i32(found) * i32(8) + i32(face)
