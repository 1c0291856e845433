# pyright: basic
"""Discs drawn into an image of depth, compiled: many are placed in the image at once, then each asks its pixels.

In single precision, whose errors are far below a pixel and the millimetre that is stored. Loops have no branches and
read one array with constant steps, or the compiler would not make them vector code.
"""

from pathlib import Path

import numpy as np

from evimo.annotate import culling
from evimo.annotate.culling import in_view, level_of
from evimo.annotate.lens import LANES
from evimo.annotate.surfaces import BLOCK
from evimo.scene.rays.compiling import compiler

NEAR = np.float32(culling.NEAR)
SINGLE = np.float32(5e-4)  # px: more than single precision errs by
WHOLE = np.float32(1e9)
ONE, TWO, THREE, HALF = np.float32(1), np.float32(2), np.float32(3), np.float32(0.5)
FIVE, SEVEN, NINE, SMALL, TINY = np.float32(5), np.float32(7), np.float32(9), np.float32(1e-6), np.float32(1e-12)
GIVEN = 7  # rows of a block of discs: centre, normal and radius
PLACED = 11  # rows of where it is: x y z in camera axes, the normal, its product with them; left right top bottom, px

_compiled = compiler(Path(__file__).parent, ("disc_drawing", "culling", "lens", "surfaces"))
jit = _compiled()
inlined = _compiled(_nrt=False, forceinline=True)


@inlined
def _bent_with_slope(px, py, singles, fisheye):
    """Where a point of the plane Z = 1 is in the image, in focal lengths, and what a step in x and in y there becomes.

    Returns u, v, du/dx, du/dy, which is dv/dx too, and dv/dy.
    """
    k1, k2, k3, p1, p2 = singles[4], singles[5], singles[6], singles[7], singles[8]
    squared = px * px + py * py
    if fisheye:
        radius = np.sqrt(squared)
        angle = np.arctan(radius)
        q = angle * angle
        ratio = angle * (ONE + q * (k1 + q * (k2 + q * (k3 + q * p1)))) / max(radius, SMALL)
        radial = (ONE + q * (THREE * k1 + q * (FIVE * k2 + q * (SEVEN * k3 + q * NINE * p1)))) / (ONE + squared)
        along = (radial - ratio) / max(squared, SMALL)
        return px * ratio, py * ratio, ratio + along * px * px, along * px * py, ratio + along * py * py
    ratio = ONE + squared * (k1 + squared * (k2 + squared * k3))
    along = TWO * (k1 + squared * (TWO * k2 + THREE * squared * k3))
    u = px * ratio + TWO * p1 * px * py + p2 * (squared + TWO * px * px)
    v = py * ratio + p1 * (squared + TWO * py * py) + TWO * p2 * px * py
    tilt = TWO * (p1 * px + p2 * py)
    u_x = ratio + along * px * px + TWO * (p1 * py + THREE * p2 * px)
    v_y = ratio + along * py * py + TWO * (p2 * px + THREE * p1 * py)
    return u, v, u_x, along * px * py + tilt, v_y


@jit
def _place_discs(discs, count, pose, lens, placed):
    """Where a block of discs is, and which pixels may see each: as `PLACED` says, right < left of what none sees.

    On Z = 1 a disc reaches as far in x as the planes through the camera
    and the y axis that touch it. From there to the image the lens is taken as straight, and `bulge` says how wrong.
    """
    fx, fy, cx, cy = lens.singles[0], lens.singles[1], lens.singles[2], lens.singles[3]
    bend, farthest2 = np.float32(4 * lens.bulge), np.float32(lens.farthest2)
    cone = np.sqrt(farthest2) - np.float32(1.9) / min(fx, fy)  # in which all rays are
    rim = np.sqrt(ONE + cone * cone)
    last_row, last_column = np.float32(lens.rays.shape[0] - 1), np.float32(lens.rays.shape[1] - 1)
    p00, p01, p02, p03 = pose[0, 0], pose[0, 1], pose[0, 2], pose[0, 3]
    p10, p11, p12, p13 = pose[1, 0], pose[1, 1], pose[1, 2], pose[1, 3]
    p20, p21, p22, p23 = pose[2, 0], pose[2, 1], pose[2, 2], pose[2, 3]
    for k in range(count):
        a, b, c, r = discs[k], discs[BLOCK + k], discs[2 * BLOCK + k], discs[6 * BLOCK + k]
        x = p00 * a + p01 * b + p02 * c + p03
        y = p10 * a + p11 * b + p12 * c + p13
        z = p20 * a + p21 * b + p22 * c + p23
        a, b, c = discs[3 * BLOCK + k], discs[4 * BLOCK + k], discs[5 * BLOCK + k]
        nx = p00 * a + p01 * b + p02 * c
        ny = p10 * a + p11 * b + p12 * c
        nz = p20 * a + p21 * b + p22 * c
        px, py = x / z, y / z
        u, v, u_x, u_y, v_y = _bent_with_slope(px, py, lens.singles, lens.fisheye)
        s = r / (z - r)
        wide = s * np.sqrt(max(ONE + px * px - (nx - px * nz) * (nx - px * nz), TINY)) + s * s * (HALF + abs(px))
        high = s * np.sqrt(max(ONE + py * py - (ny - py * nz) * (ny - py * nz), TINY)) + s * s * (HALF + abs(py))
        half_u = fx * (abs(u_x) * wide + abs(u_y) * high)
        half_v = fy * (abs(u_y) * wide + abs(v_y) * high)
        more = bend * (half_u * half_u + half_v * half_v) + SINGLE
        around = (z <= TWO * r) | (px * px + py * py > farthest2)  # farther out the lens may be none
        half_u = WHOLE if around else half_u + more
        half_v = WHOLE if around else half_v + more
        u, v = fx * u + cx, fy * v + cy
        out = (z < NEAR) | (np.sqrt(x * x + y * y) - z * cone > r * rim)
        placed[k], placed[BLOCK + k], placed[2 * BLOCK + k] = x, y, z
        placed[3 * BLOCK + k], placed[4 * BLOCK + k], placed[5 * BLOCK + k] = nx, ny, nz
        placed[6 * BLOCK + k] = nx * x + ny * y + nz * z
        placed[7 * BLOCK + k] = last_column if out else np.ceil(max(u - half_u, np.float32(0)))
        placed[8 * BLOCK + k] = -ONE if out else np.floor(min(u + half_u, last_column))
        placed[9 * BLOCK + k] = np.ceil(max(v - half_v, np.float32(0)))
        placed[10 * BLOCK + k] = np.floor(min(v + half_v, last_row))


@jit
def _draw_discs(discs, count, placed, lens, sketch):
    """Draw placed discs into the depth of their own body alone.

    Pixels are asked `LANES` at a time without branches, beyond the right border too: no disc is seen there.
    """
    ray_x, ray_y, width = lens.ray_x, lens.ray_y, lens.rays.shape[1]
    for k in range(count):
        left, right = placed[7 * BLOCK + k], placed[8 * BLOCK + k]
        top, bottom = placed[9 * BLOCK + k], placed[10 * BLOCK + k]
        if left > right or top > bottom:
            continue  # out of view, or between the centres of pixels
        x, y, z, r = placed[k], placed[BLOCK + k], placed[2 * BLOCK + k], discs[6 * BLOCK + k]
        nx, ny, nz, offset = placed[3 * BLOCK + k], placed[4 * BLOCK + k], placed[5 * BLOCK + k], placed[6 * BLOCK + k]
        back = z + r
        for row in range(int(top), int(bottom) + 1):
            for first in range(row * width + int(left), row * width + int(right) + 1, LANES):
                for lane in range(LANES):
                    pixel = np.uint64(first + lane)
                    gx, gy = ray_x[pixel], ray_y[pixel]
                    slope = nx * gx + ny * gy + nz
                    dx, dy, dz = offset * gx - slope * x, offset * gy - slope * y, offset - slope * z
                    reach, at, before = r * slope, offset / slope, sketch[pixel]
                    # Where a neighbour in the same surface is already, it stays.
                    sees = (before >= back) & (at > NEAR) & (dx * dx + dy * dy + dz * dz <= reach * reach)
                    sketch[pixel] = at if sees else before


@jit
def draw_cloud(surfaces, chunks, lens, pose, finest, sketch):
    """Draw the discs of a body, chunks (first, last + 1), into a depth (H * W + LANES) in which nothing else is."""
    discs, placed = np.empty(GIVEN * BLOCK, np.float32), np.empty(PLACED * BLOCK, np.float32)
    single, filled = pose.astype(np.float32), 0
    for chunk in range(chunks[0], chunks[1]):
        if not in_view(surfaces.chunk_balls[chunk], pose, lens.bounds):
            continue
        level = level_of(surfaces, chunk, pose, finest)
        for block in range(surfaces.levels[level, 0], surfaces.levels[level, 1]):
            if not in_view(surfaces.block_balls[block], pose, lens.bounds):
                continue
            start, stop = surfaces.blocks[block]
            if filled + stop - start > BLOCK:
                _place_discs(discs, filled, single, lens, placed)
                _draw_discs(discs, filled, placed, lens, sketch)
                filled = 0
            for row in range(GIVEN):
                first = row * BLOCK + filled
                discs[first : first + stop - start] = surfaces.discs[row, start:stop]
            filled += stop - start
    _place_discs(discs, filled, single, lens, placed)
    _draw_discs(discs, filled, placed, lens, sketch)


@jit
def show(sketch, code, depth, seen):
    """Put what of a body is nearer than all else into the image, and empty its own depth again."""
    flat, codes = depth.reshape(-1), seen.reshape(-1)
    for pixel in range(len(flat)):
        if sketch[pixel] < flat[pixel]:
            flat[pixel], codes[pixel] = sketch[pixel], code
        sketch[pixel] = np.inf
