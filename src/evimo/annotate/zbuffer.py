# pyright: basic
"""Scans drawn into an image of depth, compiled: what is nearest to the camera along the very ray of each pixel.

Nothing is clipped or approximated: a pixel shows a triangle or a disc where its own ray, the lens taken out, meets it,
and its depth is that of the point where they meet. Bounds in the image only say which pixels are asked.
"""

import math
from pathlib import Path

import numpy as np

from evimo.annotate.surfaces import BLOCK
from evimo.scene.rays.compiling import compiler

NEAR = 0.01  # m; what is nearer to the camera is not drawn
SINGLE = 2e-4  # px: more than single precision errs by
LARGE = 48.0  # px: bounds of larger triangles come from tables, as their sides are bent too much
WHOLE = 1e9
DEEPER = 0.98  # of a hole's depth: what is not nearer than that is the same surface

_compiled = compiler(Path(__file__).parent, ("zbuffer",))
jit = _compiled()
inlined = _compiled(_nrt=False, forceinline=True)


@inlined
def _bent(x, y, numbers, fisheye):
    """The pixel of a point of the plane Z = 1, and the ratio of its distances from the middle with and without lens."""
    fx, fy, cx, cy, k1, k2, k3, p1, p2 = numbers
    squared = x * x + y * y
    if fisheye:
        radius = math.sqrt(squared)
        angle = math.atan(radius)
        q = angle * angle
        ratio = angle * (1 + q * (k1 + q * (k2 + q * (k3 + q * p1)))) / radius if radius > 1e-9 else 1.0
        return fx * x * ratio + cx, fy * y * ratio + cy, ratio
    ratio = 1 + squared * (k1 + squared * (k2 + squared * k3))
    u = x * ratio + 2 * p1 * x * y + p2 * (squared + 2 * x * x)
    v = y * ratio + p1 * (squared + 2 * y * y) + 2 * p2 * x * y
    return fx * u + cx, fy * v + cy, ratio


@inlined
def _moved(pose, x, y, z):
    return (
        pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3],
        pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3],
        pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z + pose[2, 3],
    )


@inlined
def _in_view(x, y, z, reach, bounds):
    """Whether a ball may be in the image."""
    left, right, top, bottom = bounds
    return (
        z + reach > NEAR
        and x - left * z > -reach * math.sqrt(1 + left * left)
        and x - right * z < reach * math.sqrt(1 + right * right)
        and y - top * z > -reach * math.sqrt(1 + top * top)
        and y - bottom * z < reach * math.sqrt(1 + bottom * bottom)
    )


@jit
def draw(surfaces, lens, poses, codes, fine, depth, seen):
    """Draw all bodies that have a code into one image.

    poses: (B, 3, 4) camera from body. codes: (B,) written where a body is seen; 0 draws it not.
    fine: (B,) px, how large the discs of a body may be before a finer level is taken.
    depth: (H, W) f4, inf at first. seen: (H, W) u1, 0 at first.
    """
    numbers = (
        lens.numbers[0], lens.numbers[1], lens.numbers[2], lens.numbers[3], lens.numbers[4],
        lens.numbers[5], lens.numbers[6], lens.numbers[7], lens.numbers[8],
    )  # fmt: skip
    bounds = (lens.bounds[0], lens.bounds[1], lens.bounds[2], lens.bounds[3])
    focal = max(numbers[0], numbers[1])
    placed = np.empty((7, BLOCK), np.float32)
    for chunk in range(len(surfaces.chunks)):
        body, first, last = surfaces.chunks[chunk]
        if codes[body] == 0:
            continue
        pose, ball = poses[body], surfaces.chunk_balls[chunk]
        x, y, z = _moved(pose, ball[0], ball[1], ball[2])
        if not _in_view(x, y, z, ball[3], bounds):
            continue
        near = max(math.sqrt(x * x + y * y + z * z) - ball[3], NEAR)
        level = last - 1
        while level > first and surfaces.sizes[level] * focal > fine[body] * near:
            level -= 1
        for block in range(surfaces.levels[level, 0], surfaces.levels[level, 1]):
            ball = surfaces.block_balls[block]
            x, y, z = _moved(pose, ball[0], ball[1], ball[2])
            if not _in_view(x, y, z, ball[3], bounds):
                continue
            start, stop = surfaces.blocks[block]
            if surfaces.solid[chunk]:
                _draw_triangles(surfaces.corners[start:stop], pose, lens, numbers, codes[body], depth, seen)
            else:
                _place(surfaces.discs[:, start:stop], pose.astype(np.float32), lens, placed)
                _draw_discs(surfaces.discs[:, start:stop], placed, pose, lens, codes[body], depth, seen)


@jit
def _place(discs, pose, lens, placed):
    """Where discs are in camera axes and in the image, x y z u v, half their size there, and the squared radius on Z=1.

    Single precision and no branches, so that eight are done at a time; 1e-4 px is enough for bounds.
    """
    one, two = np.float32(1), np.float32(2)
    fx, fy, cx, cy, k1, k2, k3, p1, p2 = lens.singles
    focal = max(fx, fy) * np.float32(lens.stretch)
    p00, p01, p02, p03 = pose[0, 0], pose[0, 1], pose[0, 2], pose[0, 3]
    p10, p11, p12, p13 = pose[1, 0], pose[1, 1], pose[1, 2], pose[1, 3]
    p20, p21, p22, p23 = pose[2, 0], pose[2, 1], pose[2, 2], pose[2, 3]
    for k in range(discs.shape[1]):
        a, b, c, r = discs[0, k], discs[1, k], discs[2, k], discs[6, k]
        x = p00 * a + p01 * b + p02 * c + p03
        y = p10 * a + p11 * b + p12 * c + p13
        z = p20 * a + p21 * b + p22 * c + p23
        px, py = x / z, y / z
        squared = px * px + py * py
        if lens.fisheye:
            radius = np.sqrt(squared)
            angle = np.arctan(radius)
            q = angle * angle
            ratio = angle * (one + q * (k1 + q * (k2 + q * (k3 + q * p1)))) / max(radius, np.float32(1e-6))
            u, v = px * ratio, py * ratio
        else:
            ratio = one + squared * (k1 + squared * (k2 + squared * k3))
            u = px * ratio + two * p1 * px * py + p2 * (squared + two * px * px)
            v = py * ratio + p1 * (squared + two * py * py) + two * p2 * px * py
        placed[0, k], placed[1, k], placed[2, k] = x, y, z
        placed[3, k], placed[4, k] = fx * u + cx, fy * v + cy
        placed[5, k] = focal * ratio * np.sqrt(one + squared) * r / (z - r)
        placed[6, k] = squared


@jit
def _draw_discs(discs, placed, pose, lens, code, depth, seen):
    height, width = depth.shape
    for k in range(discs.shape[1]):
        z, r = placed[2, k], discs[6, k]
        if z < NEAR or placed[6, k] > lens.farthest2:
            continue
        u, v = placed[3, k], placed[4, k]
        half = placed[5, k] + SINGLE if z > 2 * r else WHOLE
        if half < 0.5 and (abs(u - np.rint(u)) > half or abs(v - np.rint(v)) > half):
            continue  # it lies between the centres of pixels
        left, right = math.ceil(max(u - half, 0.0)), math.floor(min(u + half, width - 1.0))
        top, bottom = math.ceil(max(v - half, 0.0)), math.floor(min(v + half, height - 1.0))
        if left > right or top > bottom:
            continue
        x, y = placed[0, k], placed[1, k]
        a, b, c = discs[3, k], discs[4, k], discs[5, k]
        nx = pose[0, 0] * a + pose[0, 1] * b + pose[0, 2] * c
        ny = pose[1, 0] * a + pose[1, 1] * b + pose[1, 2] * c
        nz = pose[2, 0] * a + pose[2, 1] * b + pose[2, 2] * c
        offset = nx * x + ny * y + nz * z
        for row in range(top, bottom + 1):
            for column in range(left, right + 1):
                before = depth[row, column]
                if before < z - r or (before < z + r and seen[row, column] == code):
                    continue  # hidden, or a neighbour in the same surface is there
                gx, gy = lens.rays[row, column, 0], lens.rays[row, column, 1]
                slope = nx * gx + ny * gy + nz
                if slope == 0:
                    continue
                at = offset / slope
                if not NEAR < at < before:
                    continue
                dx, dy, dz = at * gx - x, at * gy - y, at - z
                if dx * dx + dy * dy + dz * dz <= r * r:
                    depth[row, column] = at
                    seen[row, column] = code


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
            u0, v0, _ = _bent(x0, y0, numbers, lens.fisheye)
            u1, v1, _ = _bent(x1, y1, numbers, lens.fisheye)
            u2, v2, _ = _bent(x2, y2, numbers, lens.fisheye)
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
        ax, ay, az = _moved(pose, corners[k, 0], corners[k, 1], corners[k, 2])
        bx, by, bz = _moved(pose, corners[k, 3], corners[k, 4], corners[k, 5])
        cx, cy, cz = _moved(pose, corners[k, 6], corners[k, 7], corners[k, 8])
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
def fill_pinholes(depth, seen):
    """Close holes of one pixel between discs: pixels that are farther than seven of the eight around them."""
    height, width = depth.shape
    before, codes = depth.copy(), seen.copy()  # lest one that is closed closes the next, and so a slit
    for row in range(height):
        for column in range(width):
            limit, nearer, around, best, code = DEEPER * before[row, column], 0, 0, 0.0, 0
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
        fill_pinholes(depth, seen)
        seen[~np.isfinite(lens.rays[..., 0])] = 0
    return depth, seen
