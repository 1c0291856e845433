# pyright: basic
"""What a ray sees where it ends: texture, light, and which face; compiled, float32."""

import math

import numpy as np

from evimo.scene.kernels import jit

f32 = np.float32
i32 = np.int32
TEXTURE = 256
TEXTURE_LEVELS = 7

_0, _HALF, _1, _3 = f32(0), f32(0.5), f32(1), f32(3)
_TINY = f32(1e-12)
_CAP = f32(0.9999)  # beyond it along a cylinder's axis a hit is on an end
_GRAZING = f32(0.04)  # least cosine of incidence for the texture's footprint
_COARSEST = f32(TEXTURE_LEVELS - 0.001)
_SIDES = (f32(3.1), f32(5.7), f32(7.3))  # shifts that keep opposite faces of a box from looking alike


@jit
def _texel(texels, base, size, u, v):
    """Bilinear look-up that wraps around."""
    x, y = u * f32(size) - _HALF, v * f32(size) - _HALF
    fx, fy = math.floor(x), math.floor(y)
    column, row = i32(fx), i32(fy)
    fx, fy = x - f32(fx), y - f32(fy)
    last = i32(size - 1)
    left, right = column & last, (column + 1) & last
    upper, lower = base + (row & last) * size, base + ((row + 1) & last) * size
    a, b = texels[np.uint32(upper + left)], texels[np.uint32(upper + right)]
    c, d = texels[np.uint32(lower + left)], texels[np.uint32(lower + right)]
    top, bottom = a + (b - a) * fx, c + (d - c) * fx
    return top + (bottom - top) * fy


@jit
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


@jit
def shade(dx, dy, t, i, frame, parts, bank, ambient, pixel):
    """Irradiance of the hit at depth t of part i on the ray (dx, dy, 1), and its tag: part * 8 + face.

    frame: to_part (P, 3, 3), origin (P, 3) and light (P, 3). pixel: size of a pixel on Z = 1.
    """
    m, o, to_light = frame
    i = np.uint32(i)
    x = m[i, 0, 0] * dx + m[i, 0, 1] * dy + m[i, 0, 2]
    y = m[i, 1, 0] * dx + m[i, 1, 1] * dy + m[i, 1, 2]
    z = m[i, 2, 0] * dx + m[i, 2, 1] * dy + m[i, 2, 2]
    hx, hy, hz = o[i, 0] + t * x, o[i, 1] + t * y, o[i, 2] + t * z
    a, b, c = parts.half[i, 0], parts.half[i, 1], parts.half[i, 2]
    nx, ny, nz, u, v, face = _surface_point(parts.shape[i], hx, hy, hz, a, b, c)
    scale = _1 / math.sqrt(nx * nx + ny * ny + nz * nz)
    facing = -scale if parts.inside[i] != 0 else scale
    lambert = facing * (nx * to_light[i, 0] + ny * to_light[i, 1] + nz * to_light[i, 2])
    lit = ambient + (_1 - ambient) * (_HALF + _HALF * lambert)
    ex, ey, ez = x * a, y * b, z * c
    cosine = scale * abs(nx * ex + ny * ey + nz * ez) / math.sqrt(ex * ex + ey * ey + ez * ez)
    period = parts.period[i]
    footprint = t * pixel / math.sqrt(max(cosine, _GRAZING)) * f32(TEXTURE) / period
    u, v = u / period + parts.shift[i, 0], v / period + parts.shift[i, 1]
    number = i32(parts.texture[i])
    if footprint <= _1:
        pattern = _texel(bank.texels, number * TEXTURE * TEXTURE, TEXTURE, u, v)
    else:
        level = min(math.log2(footprint), _COARSEST)
        fine = i32(level)
        size, coarser = i32(TEXTURE) >> fine, i32(TEXTURE // 2) >> fine
        near = _texel(bank.texels, i32(bank.offsets[fine]) + number * size * size, size, u, v)
        far = _texel(bank.texels, i32(bank.offsets[fine + 1]) + number * coarser * coarser, coarser, u, v)
        pattern = near + (far - near) * (level - f32(fine))
    dark, bright = parts.reflectance[i, 0], parts.reflectance[i, 1]
    return (dark + (bright - dark) * pattern) * lit, i32(i) * 8 + face
