# pyright: basic
"""What a ray sees where it ends: texture, light, and which face; scalar functions, float32, for both processors.

All but the look-up in the texture is without branches once the shape is known: a loop over rays that end on one part
becomes vector instructions.
"""

import math

import numpy as np

from evimo.scene.rays.compiling import inlined, lean
from evimo.scene.rays.hits import direction, matrix
from evimo.scene.rays.mesh_hits import mesh_normal

f32 = np.float32
i32 = np.int32
TEXTURE = 256
TEXTURE_LEVELS = 7

_0, _HALF, _1, _2, _3, _4 = f32(0), f32(0.5), f32(1), f32(2), f32(3), f32(4)
SKY = f32(0.3)
SHINE = 6  # highlights are the cosine to the power of 2^6
NOTHING = -8  # tag of a ray that meets nothing
_CAP = f32(0.9999)  # beyond it along a cylinder's axis a hit is on an end
_WIDTH = f32(0.7 * TEXTURE)  # of a pixel's footprint on a texture: as many events as with 16 rays (bench/sampling.py)
_GRAZING = f32(0.04)  # least cosine of incidence for the texture's footprint
_SIDES = (f32(3.1), f32(5.7), f32(7.3))  # shifts that keep opposite faces of a box from looking alike
_QUARTER, _TURN, _TINY = f32(math.pi / 2), f32(math.pi), f32(1e-30)
_ARC = tuple(
    f32(c) for c in (0.99999988, -0.3333196, 0.19969235, -0.14016585, 0.09906097, -0.0593671, 0.02416619, -0.00466877)
)  # of the arc tangent of x over x, in powers of x², for x from 0 to 1: to 2e-7


@lean
def _angle(y, x):
    """The angle of (x, y), as `atan2` gives it, to a few 1e-7 rad."""
    wide, high = abs(x), abs(y)
    slope = min(wide, high) / max(max(wide, high), _TINY)
    s, angle = slope * slope, _ARC[7]
    angle = ((((((angle * s + _ARC[6]) * s + _ARC[5]) * s + _ARC[4]) * s + _ARC[3]) * s + _ARC[2]) * s + _ARC[1]) * s
    angle = (angle + _ARC[0]) * slope
    angle = _QUARTER - angle if high > wide else angle
    angle = _TURN - angle if x < _0 else angle
    return -angle if y < _0 else angle


@lean
def _box(hx, hy, hz, a, b, c):
    mx, my, mz = abs(hx), abs(hy), abs(hz)
    across = (mx >= my) & (mx >= mz)
    along = (my >= mz) & (not across)
    level = not (across | along)
    side = -_1 if (hx if across else (hy if along else hz)) < _0 else _1
    nx, ny, nz = side if across else _0, side if along else _0, side if level else _0
    u = (hy * b if across else hx * a) + ny * _SIDES[0]
    v = (hy * b if level else hz * c) + nx * _SIDES[2] + nz * _SIDES[1]
    first = i32(1) if across else (i32(3) if along else i32(5))
    return nx, ny, nz, u, v, first + (i32(1) if side < _0 else i32(0))


@lean
def _ellipsoid(hx, hy, hz, a, b, c):
    radius = (a + b + c) / _3
    v = _angle(hz, math.sqrt(max(_0, _1 - hz * hz))) * radius
    return hx / a, hy / b, hz / c, _angle(hy, hx) * radius, v, i32(0)


@lean
def _cylinder(hx, hy, hz, a, b, c):
    end = abs(hz) > _CAP
    u, v = _angle(hy, hx) * _HALF * (a + b), hz * c
    nx, ny, nz = _0 if end else hx / a, _0 if end else hy / b, (_1 if hz > _0 else -_1) if end else _0
    return nx, ny, nz, hx * a if end else u, hy * b if end else v, i32(1) if end else i32(0)


@inlined
def surface(shape, hit, half, ray, met):
    """Normal (not unit, metric), texture coordinates in m, and face of a hit.

    Args:
        hit: (3,) in unit space. half: (3,) half sizes. ray: (3,) direction in unit space.
        met: `MeshBank` and triangle, where the shape is a mesh.
    """
    (hx, hy, hz), (a, b, c), (x, y, z) = hit, half, ray
    if shape == 0:
        return _box(hx, hy, hz, a, b, c)
    if shape == 1:
        return _ellipsoid(hx, hy, hz, a, b, c)
    if shape == 2:
        return _cylinder(hx, hy, hz, a, b, c)
    if shape == 3:  # a net has no inside: it is lit on the side that is seen
        return _0, _0, -_1 if z > _0 else _1, hx * a, hy * b, i32(1)
    nx, ny, nz, axis = mesh_normal(met[0].corners, met[0].normals, met[1], hx, hy, hz, x, y, z)
    u, v = hy if axis == 0 else hx, hy if axis == 2 else hz  # laid on along the axis that the triangle faces most
    return nx, ny, nz, u * a, v * a, i32(axis)


@lean
def part_row(i, frame, parts):
    """What shading needs of part i, as numbers.

    Returns:
        camera axes to unit space (9,) and the camera there (3,); direction to the light in the part's axes (3,); half
        sizes (3,); 1 / period and shift (3,) of its texture; gloss, and the sign of normals (2,).
    """
    origin, light, half, shift = frame[1], frame[2], parts.half, parts.shift
    return (
        matrix(frame[0], i),
        (origin[i, 0], origin[i, 1], origin[i, 2]),
        (light[i, 0], light[i, 1], light[i, 2]),
        (half[i, 0], half[i, 1], half[i, 2]),
        (_1 / parts.period[i], shift[i, 0], shift[i, 1]),
        (parts.gloss[i], _1 if parts.inside[i] == 0 else -_1),
    )


@lean
def _highlight(n, view, to_light):
    """Blinn's highlight of unit normal, direction to the camera and to the light; 1 in its middle."""
    hx, hy, hz = view[0] + to_light[0], view[1] + to_light[1], view[2] + to_light[2]
    length = math.sqrt(hx * hx + hy * hy + hz * hz)
    shine = max(_0, n[0] * hx + n[1] * hy + n[2] * hz) / max(length, _GRAZING)
    for _ in range(SHINE):
        shine *= shine
    return shine


@lean
def _level(footprint):
    """The finer of the two mip levels for a footprint in texels of the finest, and the share of the coarser one."""
    fine, size = i32(0), _1
    for _ in range(TEXTURE_LEVELS - 1):
        more = footprint >= _2 * size
        fine, size = fine + (i32(1) if more else i32(0)), _2 * size if more else size
    return fine, min(_1, max(_0, footprint / size - _1))


@inlined
def lit(shape, ray, hit, row, light, met):
    """Everything about the end of a ray but its texture.

    Args:
        shape: of the part. ray: (dx, dy) of the ray (dx, dy, 1). row: of `part_row`. met: as in `surface`.
        hit: depth, and the share of the directed light that no other body hides.
        light: share of light without direction, size of a pixel on Z = 1.

    Returns:
        Texture coordinates in periods, mip level and the share of the next, light, irradiance of a highlight, face.
    """
    (t, left), (to_part, (ox, oy, oz), (lx, ly, lz), (a, b, c), texture, (gloss, sign)) = hit, row
    x, y, z = direction(to_part, ray[0], ray[1])
    nx, ny, nz, u, v, face = surface(shape, (ox + t * x, oy + t * y, oz + t * z), (a, b, c), (x, y, z), met)
    scale = sign / math.sqrt(nx * nx + ny * ny + nz * nz)
    nx, ny, nz = scale * nx, scale * ny, scale * nz
    lambert = nx * lx + ny * ly + nz * lz
    ex, ey, ez = x * a, y * b, z * c
    nearer = -_1 / math.sqrt(ex * ex + ey * ey + ez * ez)  # times (ex, ey, ez): towards the camera
    cosine = max(abs(nearer * (nx * ex + ny * ey + nz * ez)), _GRAZING)
    fine, share = _level(_WIDTH * t * light[1] * texture[0] / math.sqrt(cosine))
    facing = min(_1, _4 * max(_0, lambert))  # what hardly faces the light gets none of it that could be shaded
    left = _1 - facing * (_1 - left)
    bright = light[0] + (_1 - light[0]) * left * (_HALF + _HALF * lambert)
    view = nearer * ex, nearer * ey, nearer * ez
    shine = gloss * facing * left * _highlight((nx, ny, nz), view, (lx, ly, lz))
    return u * texture[0] + texture[1], v * texture[0] + texture[2], fine, share, bright, shine, face


@inlined
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


@inlined
def pattern(texels, offsets, number, u, v, fine, share):
    """Texture `number` at u, v in periods, between mip level `fine` and the next: a share of that one."""
    size, coarser = i32(TEXTURE) >> fine, i32(TEXTURE // 2) >> fine
    near = _texel(texels, i32(offsets[fine]) + number * size * size, size, u, v)
    if share <= _0:
        return near
    far = _texel(texels, i32(offsets[fine + 1]) + number * coarser * coarser, coarser, u, v)
    return near + (far - near) * share


@lean
def shade_ray(dx, dy, hit, frame, things, light, left):
    """Irradiance and tag of a ray (dx, dy, 1) that ends on a part; a tag is part * 8 + face.

    Args:
        hit: depth, part, and triangle of a mesh. frame: as in `hits.hit_part`.
        things: `bodies.Parts`, `TextureBank`, `MeshBank`.
        light: (2,) share of light without direction; size of a pixel on Z = 1.
        left: share of the directed light that no other body hides.
    """
    (t, found, triangle), (parts, bank, meshes) = hit, things
    i = np.uint32(found)  # unsigned: no test for counting from the end
    row, around = part_row(i, frame, parts), (light[0], light[1])
    shape, met = parts.shape[i], (meshes, triangle)
    u, v, fine, share, bright, shine, face = lit(shape, (dx, dy), (t, left), row, around, met)
    seen = pattern(bank.texels, bank.offsets, parts.texture[i], u, v, fine, share)
    dark = parts.reflectance[i, 0]
    return (dark + (parts.reflectance[i, 1] - dark) * seen) * bright + shine, i32(found) * i32(8) + face
