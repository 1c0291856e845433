# pyright: basic
"""What a ray sees where it ends: texture, light, and which face; scalar functions, float32, for both processors."""

import math

import numpy as np

from evimo.scene.compiling import inlined, lean
from evimo.scene.hits import direction
from evimo.scene.mesh_hits import mesh_normal
from evimo.scene.shadows import light_left

f32 = np.float32
i32 = np.int32
TEXTURE = 256
TEXTURE_LEVELS = 7

_0, _HALF, _1, _3, _4 = f32(0), f32(0.5), f32(1), f32(3), f32(4)
SKY = f32(0.3)
SHINE = 6  # highlights are the cosine to the power of 2^6
NOTHING = -8  # tag of a ray that meets nothing
_CAP = f32(0.9999)  # beyond it along a cylinder's axis a hit is on an end
_WIDTH = f32(0.7)  # of a pixel's footprint on a texture, px: as many events as with 16 rays (bench/sampling.py)
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
def _mesh_point(meshes, triangle, hx, hy, hz, x, y, z, half):
    """As `_surface_point`, of a triangle; textures are laid on along the axis that it faces most."""
    nx, ny, nz, axis = mesh_normal(meshes.corners, meshes.normals, triangle, hx, hy, hz, x, y, z)
    u = hy if axis == 0 else hx
    v = hy if axis == 2 else hz
    return nx, ny, nz, u * half, v * half, axis


@lean
def _highlight(n, view, to_light):
    """Blinn's highlight of unit normal, direction to the camera and to the light; 1 in its middle."""
    hx, hy, hz = view[0] + to_light[0], view[1] + to_light[1], view[2] + to_light[2]
    length = math.sqrt(hx * hx + hy * hy + hz * hz)
    shine = max(_0, n[0] * hx + n[1] * hy + n[2] * hz) / max(length, _GRAZING)
    for _ in range(SHINE):
        shine *= shine
    return shine


@inlined
def _reflectance(i, parts, bank, u, v, width, cosine):
    """Of part i at texture coordinates in m, averaged over a pixel `width` m wide, seen at an angle."""
    per_m = _1 / parts.period[i]
    footprint = width * f32(TEXTURE) * per_m / math.sqrt(max(abs(cosine), _GRAZING))
    u, v = u * per_m + parts.shift[i, 0], v * per_m + parts.shift[i, 1]
    pattern = _pattern(bank.texels, bank.offsets, parts.texture[i], footprint, u, v)
    dark, bright = parts.reflectance[i, 0], parts.reflectance[i, 1]
    return dark + (bright - dark) * pattern


@inlined
def shade_ray(dx, dy, hit, frame, things, light, shadows):
    """Irradiance and tag of a ray (dx, dy, 1) that ends on a part; a tag is part * 8 + face.

    Args:
        hit: depth, part, and triangle of a mesh. frame: as in `hits.hit_part`.
        things: `bodies.Parts`, `textures.TextureBank`, `meshes.MeshBank`.
        light: (3,) share of light without direction; size of a pixel on Z = 1; angular radius of the light.
        shadows: casters (Q,) and how many of them count: the parts that may stand in the light here.
    """
    (t, found, triangle), (parts, bank, meshes) = hit, things
    to_part, origin, to_light = frame[0], frame[1], frame[2]
    i, ambient, pixel = np.uint32(found), light[0], light[1]  # unsigned: no test for counting from the end
    shape = parts.shape[i]
    x, y, z = direction(to_part, i, dx, dy)
    hx, hy, hz = origin[i, 0] + t * x, origin[i, 1] + t * y, origin[i, 2] + t * z
    hz = -z if shape == 3 else hz  # a net has no inside: it is lit on the side that is seen
    a, b, c = parts.half[i, 0], parts.half[i, 1], parts.half[i, 2]
    if shape == 4:
        nx, ny, nz, u, v, face = _mesh_point(meshes, triangle, hx, hy, hz, x, y, z, a)
    else:
        nx, ny, nz, u, v, face = _surface_point(shape, hx, hy, hz, a, b, c)
    scale = _1 / math.sqrt(nx * nx + ny * ny + nz * nz)
    scale = -scale if parts.inside[i] != 0 else scale
    nx, ny, nz = scale * nx, scale * ny, scale * nz
    lx, ly, lz = to_light[i, 0], to_light[i, 1], to_light[i, 2]
    lambert = nx * lx + ny * ly + nz * lz
    ex, ey, ez = x * a, y * b, z * c
    nearer = -_1 / math.sqrt(ex * ex + ey * ey + ez * ez)  # times (ex, ey, ez): towards the camera
    cosine = nearer * (nx * ex + ny * ey + nz * ez)
    reflectance = _reflectance(i, parts, bank, u, v, _WIDTH * t * pixel, cosine)
    facing = min(_1, _4 * max(_0, lambert))  # what hardly faces the light gets none of it that could be shaded
    left = _1
    if shadows[1] > 0 and facing > _0:
        left = light_left(i, (t * dx, t * dy, t), frame, parts, light[2], shadows[0], shadows[1])
    left = _1 - facing * (_1 - left)
    seen = reflectance * (ambient + (_1 - ambient) * left * (_HALF + _HALF * lambert))
    if parts.gloss[i] > _0:
        view = nearer * ex, nearer * ey, nearer * ez
        seen += parts.gloss[i] * facing * left * _highlight((nx, ny, nz), view, (lx, ly, lz))
    return seen, i32(found) * i32(8) + i32(face)
