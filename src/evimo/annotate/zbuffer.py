# pyright: basic
"""Scans drawn into an image of depth, compiled: what is nearest to the camera along the very ray of each pixel.

Nothing is clipped or approximated: a pixel shows a triangle or a disc where its own ray, the lens taken out, meets it,
and its depth is that of the point where they meet. Bounds in the image only say which pixels are asked.
"""

import math
from pathlib import Path

import numpy as np

from evimo.annotate.culling import NEAR, in_view, moved
from evimo.annotate.disc_drawing import draw_cloud, show
from evimo.scene.rays.compiling import compiler

LARGE = 48.0  # px: bounds of larger triangles come from tables, as their sides are bent too much
DEEPER = 0.98  # of a hole's depth: what is not nearer than that is the same surface

_compiled = compiler(Path(__file__).parent, ("zbuffer", "disc_drawing", "culling", "lens", "surfaces"))
jit = _compiled()
inlined = _compiled(_nrt=False, forceinline=True)


@inlined
def _bent(x, y, numbers, fisheye):
    """The pixel of a point of the plane Z = 1."""
    fx, fy, cx, cy, k1, k2, k3, p1, p2 = numbers
    squared = x * x + y * y
    if fisheye:
        radius = math.sqrt(squared)
        angle = math.atan(radius)
        q = angle * angle
        ratio = angle * (1 + q * (k1 + q * (k2 + q * (k3 + q * p1)))) / radius if radius > 1e-9 else 1.0
        return fx * x * ratio + cx, fy * y * ratio + cy
    ratio = 1 + squared * (k1 + squared * (k2 + squared * k3))
    u = x * ratio + 2 * p1 * x * y + p2 * (squared + 2 * x * x)
    v = y * ratio + p1 * (squared + 2 * y * y) + 2 * p2 * x * y
    return fx * u + cx, fy * v + cy


@jit
def draw(surfaces, lens, poses, codes, fine, depth, seen):
    """Draw all bodies that have a code into one image.

    poses: (B, 3, 4) camera from body. codes: (B,) written where a body is seen; 0 draws it not.
    fine: (B,) px, how large the discs of a body may be before a finer level is taken.
    depth: (H, W) f4, inf at first. seen: (H, W) u1, 0 at first.
    """
    sketch = np.full(len(lens.ray_x), np.inf, np.float32)
    last = 0
    for body in range(len(codes)):
        first = last
        while last < len(surfaces.chunks) and surfaces.chunks[last, 0] == body:
            last += 1
        if codes[body] == 0 or first == last:
            continue
        if surfaces.solid[first]:
            _draw_mesh(surfaces, (first, last), lens, poses[body], codes[body], depth, seen)
        else:
            finest = fine[body] / max(lens.numbers[0], lens.numbers[1])
            draw_cloud(surfaces, (first, last), lens, poses[body], finest, sketch)
            show(sketch, codes[body], depth, seen)


@jit
def _draw_mesh(surfaces, chunks, lens, pose, code, depth, seen):
    numbers = (
        lens.numbers[0], lens.numbers[1], lens.numbers[2], lens.numbers[3], lens.numbers[4],
        lens.numbers[5], lens.numbers[6], lens.numbers[7], lens.numbers[8],
    )  # fmt: skip
    for chunk in range(chunks[0], chunks[1]):
        if not in_view(surfaces.chunk_balls[chunk], pose, lens.bounds):
            continue
        level = surfaces.chunks[chunk, 1]
        for block in range(surfaces.levels[level, 0], surfaces.levels[level, 1]):
            if in_view(surfaces.block_balls[block], pose, lens.bounds):
                start, stop = surfaces.blocks[block]
                _draw_triangles(surfaces.corners[start:stop], pose, lens, numbers, code, depth, seen)


@inlined
def _span(low, high, table):
    """The first and last column (or row) in which some ray lies between two bounds."""
    first, last = 0, table.shape[1] - 1
    while first <= last and (table[1, first] < low or table[0, first] > high):
        first += 1
    while last >= first and (table[1, last] < low or table[0, last] > high):
        last -= 1
    return first, last


@inlined
def _pixels_of(ax, ay, az, bx, by, bz, cx, cy, cz, lens, numbers, height, width):
    """Left, right, top and bottom of the pixels that may see a triangle."""
    whole = az > NEAR and bz > NEAR and cz > NEAR
    if whole:
        x0, y0, x1, y1, x2, y2 = ax / az, ay / az, bx / bz, by / bz, cx / cz, cy / cz
        farthest = max(x0 * x0 + y0 * y0, x1 * x1 + y1 * y1, x2 * x2 + y2 * y2)
        if farthest <= lens.farthest2:
            u0, v0 = _bent(x0, y0, numbers, lens.fisheye)
            u1, v1 = _bent(x1, y1, numbers, lens.fisheye)
            u2, v2 = _bent(x2, y2, numbers, lens.fisheye)
            left, right, top, bottom = min(u0, u1, u2), max(u0, u1, u2), min(v0, v1, v2), max(v0, v1, v2)
            size2 = (right - left) ** 2 + (bottom - top) ** 2
            if size2 < LARGE * LARGE:
                more = lens.bulge * size2 + 1e-3
                return (
                    math.ceil(max(left - more, 0.0)),
                    math.floor(min(right + more, width - 1.0)),
                    math.ceil(max(top - more, 0.0)),
                    math.floor(min(bottom + more, height - 1.0)),
                )
        first, last = _span(min(x0, x1, x2), max(x0, x1, x2), lens.columns)
        top, bottom = _span(min(y0, y1, y2), max(y0, y1, y2), lens.rows)
        return first, last, top, bottom
    return 0, width - 1, 0, height - 1


@jit
def _draw_triangles(corners, pose, lens, numbers, code, depth, seen):
    height, width = depth.shape
    for k in range(len(corners)):
        ax, ay, az = moved(pose, corners[k, 0], corners[k, 1], corners[k, 2])
        bx, by, bz = moved(pose, corners[k, 3], corners[k, 4], corners[k, 5])
        cx, cy, cz = moved(pose, corners[k, 6], corners[k, 7], corners[k, 8])
        if max(az, bz, cz) < NEAR:
            continue
        left, right, top, bottom = _pixels_of(ax, ay, az, bx, by, bz, cx, cy, cz, lens, numbers, height, width)
        if left > right or top > bottom:
            continue
        # The planes through the camera and each side; a ray is inside where it lies on the same side of all three.
        n0x, n0y, n0z = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        n1x, n1y, n1z = cy * az - cz * ay, cz * ax - cx * az, cx * ay - cy * ax
        n2x, n2y, n2z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        volume = ax * n0x + ay * n0y + az * n0z
        if volume == 0:
            continue
        sign = 1.0 if volume > 0 else -1.0
        for row in range(top, bottom + 1):
            for column in range(left, right + 1):
                gx, gy = lens.rays[row, column, 0], lens.rays[row, column, 1]
                e0 = sign * (n0x * gx + n0y * gy + n0z)
                e1 = sign * (n1x * gx + n1y * gy + n1z)
                e2 = sign * (n2x * gx + n2y * gy + n2z)
                if not (e0 >= 0 and e1 >= 0 and e2 >= 0):
                    continue
                total = e0 + e1 + e2
                at = sign * volume / total if total > 0 else 0.0
                if NEAR < at < depth[row, column]:
                    depth[row, column] = at
                    seen[row, column] = code


@jit
def fill_pinholes(lens, depth, seen):
    """Close holes of one pixel between discs: pixels that are farther than seven of the eight around them."""
    height, width = depth.shape
    before, codes = depth.copy(), seen.copy()  # lest one that is closed closes the next, and so a slit
    for row in range(height):
        for column in range(width):
            limit, nearer, around, best, code = DEEPER * before[row, column], 0, 0, 0.0, 0
            if column > 0 and row > 0 and before[row, column - 1] >= limit and before[row - 1, column] >= limit:
                continue  # two that are not nearer are too many: most pixels end here
            if np.isnan(lens.rays[row, column, 0]):
                continue
            for down in range(max(row - 1, 0), min(row + 2, height)):
                for right in range(max(column - 1, 0), min(column + 2, width)):
                    if down == row and right == column:
                        continue
                    around += 1
                    if before[down, right] < limit:
                        nearer += 1
                        if before[down, right] > best:
                            best, code = before[down, right], codes[down, right]
            if nearer >= (7 if around == 8 else around):
                depth[row, column], seen[row, column] = best, code


def drawn(surfaces, lens, poses, codes, fine):
    """Depth (H, W) float32, inf where nothing is seen, and the code of what is seen (H, W) uint8; as `draw` says."""
    size = lens.rays.shape[:2]
    depth, seen = np.full(size, np.inf, np.float32), np.zeros(size, np.uint8)
    draw(surfaces, lens, np.ascontiguousarray(poses, np.float64), np.asarray(codes, np.uint8), fine, depth, seen)
    if surfaces.discs.shape[1]:
        fill_pinholes(lens, depth, seen)
    return depth, seen
