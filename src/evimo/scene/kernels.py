# pyright: basic
"""The ray caster's compiled kernels: float32 throughout, one tile at a time.

numba promotes float32 with a bare float literal to float64, so constants are float32 by name.
"""

import math

import numba
import numpy as np

f32 = np.float32
i32 = np.int32
TILE = 16
TEXTURE = 256
TEXTURE_LEVELS = 7
NOTHING = -8  # tag of a ray that meets nothing; others are part * 8 + face

_0, _HALF, _1, _3 = f32(0), f32(0.5), f32(1), f32(3)
_NEAR, _FAR, _TINY = f32(1e-3), f32(1e9), f32(1e-12)
_CAP = f32(0.9999)  # beyond it along a cylinder's axis a hit is on an end
_GRAZING = f32(0.04)  # least cosine of incidence for the texture's footprint
_SKY = f32(0.3)
_SIDES = (f32(3.1), f32(5.7), f32(7.3))  # shifts that keep opposite faces of a box from looking alike
_SLACK = f32(0.006)

_jit = numba.njit(fastmath=True, nogil=True, error_model="numpy", cache=True)
_parallel = numba.njit(fastmath=True, nogil=True, error_model="numpy", cache=True, parallel=True)


@_jit
def _inverse(x):
    return _1 / (x if abs(x) > _TINY else _TINY)


@_jit
def _box(ox, oy, oz, dx, dy, dz, inside):
    ix, iy, iz = _inverse(dx), _inverse(dy), _inverse(dz)
    ax, bx = (-_1 - ox) * ix, (_1 - ox) * ix
    ay, by = (-_1 - oy) * iy, (_1 - oy) * iy
    az, bz = (-_1 - oz) * iz, (_1 - oz) * iz
    near = max(min(ax, bx), max(min(ay, by), min(az, bz)))
    far = min(max(ax, bx), min(max(ay, by), max(az, bz)))
    if far < near:
        return -_1
    return far if inside != 0 else near


@_jit
def _ellipsoid(ox, oy, oz, dx, dy, dz):
    a = dx * dx + dy * dy + dz * dz
    b = ox * dx + oy * dy + oz * dz
    root = b * b - a * (ox * ox + oy * oy + oz * oz - _1)
    return -_1 if root < _0 else (-b - math.sqrt(root)) / a


@_jit
def _cylinder(ox, oy, oz, dx, dy, dz):
    a = max(dx * dx + dy * dy, _TINY)
    b = ox * dx + oy * dy
    root = b * b - a * (ox * ox + oy * oy - _1)
    if root < _0:
        return -_1
    side = math.sqrt(root)
    iz = _inverse(dz)
    za, zb = (-_1 - oz) * iz, (_1 - oz) * iz
    near = max((-b - side) / a, min(za, zb))
    far = min((-b + side) / a, max(za, zb))
    return near if far >= near else -_1


@_jit
def _grating(ox, oy, oz, dx, dy, dz, bars):
    t = -oz * _inverse(dz)
    x, y = ox + t * dx, oy + t * dy
    if abs(x) > _1 or abs(y) > _1:
        return -_1
    u, v = (x + _1) * bars[0], (y + _1) * bars[1]
    solid = u - math.floor(u) < bars[2] or v - math.floor(v) < bars[3]
    return t if solid else -_1


@_jit
def trace(dx, dy, placed, f, parts, candidates, count):
    """The nearest part along (dx, dy, 1) at time f: its depth and index, or a negative index."""
    best, found = _FAR, i32(-1)
    for k in range(count):
        i = candidates[k]
        m, o = placed.to_part, placed.origin
        x = m[f, i, 0, 0] * dx + m[f, i, 0, 1] * dy + m[f, i, 0, 2]
        y = m[f, i, 1, 0] * dx + m[f, i, 1, 1] * dy + m[f, i, 1, 2]
        z = m[f, i, 2, 0] * dx + m[f, i, 2, 1] * dy + m[f, i, 2, 2]
        ox, oy, oz = o[f, i, 0], o[f, i, 1], o[f, i, 2]
        shape = parts.shape[i]
        if shape == 0:
            t = _box(ox, oy, oz, x, y, z, parts.inside[i])
        elif shape == 1:
            t = _ellipsoid(ox, oy, oz, x, y, z)
        elif shape == 2:
            t = _cylinder(ox, oy, oz, x, y, z)
        else:
            t = _grating(ox, oy, oz, x, y, z, parts.openings[i])
        if t > _NEAR and t < best:
            best, found = t, i32(i)
    return best, found


@_jit
def _texel(texels, base, size, u, v):
    """Bilinear look-up that wraps around."""
    x, y = u * f32(size) - _HALF, v * f32(size) - _HALF
    fx, fy = math.floor(x), math.floor(y)
    column, row = i32(fx), i32(fy)
    fx, fy = x - f32(fx), y - f32(fy)
    last = size - 1
    left, right = column & last, (column + 1) & last
    upper, lower = base + (row & last) * size, base + ((row + 1) & last) * size
    top = texels[upper + left] * (_1 - fx) + texels[upper + right] * fx
    bottom = texels[lower + left] * (_1 - fx) + texels[lower + right] * fx
    return top * (_1 - fy) + bottom * fy


@_jit
def _surface_point(shape, hx, hy, hz, half):
    """Normal (not unit, metric), texture coordinates in m, and face of a hit in unit space."""
    a, b, c = half[0], half[1], half[2]
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


@_jit
def shade(dx, dy, t, i, placed, f, parts, bank, ambient, pixel):
    """Irradiance of the hit at depth t of part i, and its tag."""
    m, o = placed.to_part, placed.origin
    x = m[f, i, 0, 0] * dx + m[f, i, 0, 1] * dy + m[f, i, 0, 2]
    y = m[f, i, 1, 0] * dx + m[f, i, 1, 1] * dy + m[f, i, 1, 2]
    z = m[f, i, 2, 0] * dx + m[f, i, 2, 1] * dy + m[f, i, 2, 2]
    hx, hy, hz = o[f, i, 0] + t * x, o[f, i, 1] + t * y, o[f, i, 2] + t * z
    half = parts.half[i]
    nx, ny, nz, u, v, face = _surface_point(parts.shape[i], hx, hy, hz, half)
    scale = _1 / math.sqrt(nx * nx + ny * ny + nz * nz)
    facing = -scale if parts.inside[i] != 0 else scale
    light = placed.light[f, i]
    lambert = facing * (nx * light[0] + ny * light[1] + nz * light[2])
    lit = ambient + (_1 - ambient) * (_HALF + _HALF * lambert)
    ex, ey, ez = x * half[0], y * half[1], z * half[2]
    cosine = scale * abs(nx * ex + ny * ey + nz * ez) / math.sqrt(ex * ex + ey * ey + ez * ez)
    period = parts.period[i]
    footprint = t * pixel / math.sqrt(max(cosine, _GRAZING)) * f32(TEXTURE) / period
    level = min(max(math.log2(max(footprint, _TINY)), _0), f32(TEXTURE_LEVELS) - f32(1e-3))
    fine = i32(level)
    blend = f32(level) - f32(fine)
    u, v = u / period + parts.shift[i, 0], v / period + parts.shift[i, 1]
    size = TEXTURE >> fine
    coarser = size >> 1
    number = parts.texture[i]
    near = _texel(bank.texels, bank.offsets[fine] + number * size * size, size, u, v)
    far = _texel(bank.texels, bank.offsets[fine + 1] + number * coarser * coarser, coarser, u, v)
    pattern = near * (_1 - blend) + far * blend
    dark, bright = parts.reflectance[i, 0], parts.reflectance[i, 1]
    return (dark + (bright - dark) * pattern) * lit, i * 8 + face


@_jit
def _candidates(rays, box, placed, f, parts, found):
    """Parts whose bounding sphere meets the cone around a tile; returns their count and whether one is a grating."""
    y0, y1, x0, x1 = box
    cx, cy = rays[0, (y0 + y1) // 2, (x0 + x1) // 2, 0], rays[0, (y0 + y1) // 2, (x0 + x1) // 2, 1]
    norm = _1 / math.sqrt(cx * cx + cy * cy + _1)
    least = _1
    for corner in range(4):
        ray = rays[0, y0 if corner < 2 else y1 - 1, x0 if corner % 2 == 0 else x1 - 1]
        least = min(least, (ray[0] * cx + ray[1] * cy + _1) * norm / math.sqrt(ray[0] ** 2 + ray[1] ** 2 + _1))
    opening = math.acos(max(-_1, min(_1, least))) + _SLACK
    count, netted = 0, False
    for i in range(len(parts.shape)):
        x, y, z = placed.centre[f, i, 0], placed.centre[f, i, 1], placed.centre[f, i, 2]
        distance, radius = math.sqrt(x * x + y * y + z * z), parts.radius[i]
        meets = parts.inside[i] != 0 or distance <= radius * f32(1.02)
        if not meets:
            angle = math.acos(max(-_1, min(_1, (x * cx + y * cy + z) * norm / distance)))
            meets = angle <= opening + math.asin(min(_1, radius / distance))
        if meets:
            found[count] = i
            count += 1
            netted = netted or parts.shape[i] == 3
    return count, netted


@_parallel
def render(rays, placed, parts, bank, ambient, pixel):
    """Frames through a lens.

    Args:
        rays: (1 + S, H, W, 2), the ray of each pixel's centre on Z = 1, then S rays within it, cast only at edges.
        placed, parts, bank: the scene (`bodies.Placed`, `bodies.Parts`, `textures.TextureBank`).
        ambient, pixel: share of light without direction; size of a pixel on Z = 1.
    Returns:
        irradiance (F, H, W), depth (F, H, W), tags (F, H, W) int16: part * 8 + face of the centre ray.
    """
    frames, (height, width) = placed.to_part.shape[0], rays.shape[1:3]
    samples = rays.shape[0]
    rows, columns = (height + TILE - 1) // TILE, (width + TILE - 1) // TILE
    image = np.empty((frames, height, width), np.float32)
    depth = np.empty((frames, height, width), np.float32)
    tags = np.empty((frames, height, width), np.int16)
    listed = np.empty((frames, rows, columns, len(parts.shape)), np.int32)
    counts = np.empty((frames, rows, columns), np.int32)
    nets = np.empty((frames, rows, columns), np.bool_)
    for job in numba.prange(frames * rows):
        f, row = job // rows, job % rows
        y0, y1 = row * TILE, min(height, row * TILE + TILE)
        for column in range(columns):
            x0, x1 = column * TILE, min(width, column * TILE + TILE)
            found = listed[f, row, column]
            count, nets[f, row, column] = _candidates(rays, (y0, y1, x0, x1), placed, f, parts, found)
            counts[f, row, column] = count
            for y in range(y0, y1):
                for x in range(x0, x1):
                    dx, dy = rays[0, y, x, 0], rays[0, y, x, 1]
                    t, i = trace(dx, dy, placed, f, parts, found, count)
                    light, tag = _SKY, NOTHING
                    if i >= 0:
                        light, tag = shade(dx, dy, t, i, placed, f, parts, bank, ambient, pixel)
                    image[f, y, x], depth[f, y, x], tags[f, y, x] = light, t, tag
    for job in numba.prange(frames * rows):
        f, row = job // rows, job % rows
        for y in range(row * TILE, min(height, row * TILE + TILE)):
            up, down = max(y - 1, 0), min(y + 1, height - 1)
            for x in range(width):
                tag = tags[f, y, x]
                left, right = max(x - 1, 0), min(x + 1, width - 1)
                edge = tags[f, y, left] != tag or tags[f, y, right] != tag
                edge = edge or tags[f, up, x] != tag or tags[f, down, x] != tag
                column = x // TILE
                if edge or nets[f, row, column]:
                    total = _0
                    for s in range(1, samples):
                        dx, dy = rays[s, y, x, 0], rays[s, y, x, 1]
                        t, i = trace(dx, dy, placed, f, parts, listed[f, row, column], counts[f, row, column])
                        if i >= 0:
                            total += shade(dx, dy, t, i, placed, f, parts, bank, ambient, pixel)[0]
                        else:
                            total += _SKY
                    image[f, y, x] = total / f32(samples - 1)
    return image, depth, tags


@_jit
def cast(rays, placed, parts):
    """Depth (F, N) and part index (F, N), negative where nothing, of rays (N, 2) on Z = 1, against every part."""
    frames, number = placed.to_part.shape[0], rays.shape[0]
    depth, found = np.empty((frames, number), np.float32), np.empty((frames, number), np.int32)
    everything = np.arange(len(parts.shape)).astype(np.int32)
    for f in range(frames):
        for n in range(number):
            depth[f, n], found[f, n] = trace(rays[n, 0], rays[n, 1], placed, f, parts, everything, len(everything))
    return depth, found
