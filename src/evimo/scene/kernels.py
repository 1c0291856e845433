# pyright: basic
"""Many rays at a time on the CPU: the nearest parts they meet, and what they see there.

Each part meets all rays of a tile in one loop without branches, which the compiler turns into vector instructions.
"""

import numpy as np

from evimo.scene.compiling import jit, lean
from evimo.scene.hits import FAR, NEAR, direction, hit_box, hit_cylinder, hit_ellipsoid, hit_grating
from evimo.scene.shading import NOTHING, SKY, shade_ray

i32 = np.int32


@lean
def _keep(t, i, k, depth, found):
    nearer = t > NEAR and t < depth[k]
    depth[k] = t if nearer else depth[k]
    found[k] = i if nearer else found[k]


@lean
def _boxes(rays, number, i, to_part, origin, inside, depth, found):
    ox, oy, oz = origin[i, 0], origin[i, 1], origin[i, 2]
    for k in range(number):
        x, y, z = direction(to_part, i, rays[0, k], rays[1, k])
        _keep(hit_box(ox, oy, oz, x, y, z, inside), i, k, depth, found)


@lean
def _ellipsoids(rays, number, i, to_part, origin, depth, found):
    ox, oy, oz = origin[i, 0], origin[i, 1], origin[i, 2]
    for k in range(number):
        x, y, z = direction(to_part, i, rays[0, k], rays[1, k])
        _keep(hit_ellipsoid(ox, oy, oz, x, y, z), i, k, depth, found)


@lean
def _cylinders(rays, number, i, to_part, origin, depth, found):
    ox, oy, oz = origin[i, 0], origin[i, 1], origin[i, 2]
    for k in range(number):
        x, y, z = direction(to_part, i, rays[0, k], rays[1, k])
        _keep(hit_cylinder(ox, oy, oz, x, y, z), i, k, depth, found)


@lean
def _gratings(rays, number, i, to_part, origin, bars, depth, found):
    ox, oy, oz = origin[i, 0], origin[i, 1], origin[i, 2]
    across, down, wide, high = bars[i, 0], bars[i, 1], bars[i, 2], bars[i, 3]
    for k in range(number):
        x, y, z = direction(to_part, i, rays[0, k], rays[1, k])
        _keep(hit_grating(ox, oy, oz, x, y, z, across, down, wide, high), i, k, depth, found)


@lean
def trace(rays, number, frame, parts, listed, count, depth, found):
    """The nearest of the listed parts along rays (x, y, 1).

    Args:
        rays: (2, N) x and y on Z = 1, of which the first `number` count. frame: as in `hits.hit_part`.
        listed, count: indices of parts to try. depth, found: (N,) written: z in m and part, negative where nothing.
    """
    to_part, origin, _ = frame
    for k in range(number):
        depth[k], found[k] = FAR, i32(-1)
    for c in range(count):
        i = listed[c]
        shape = parts.shape[i]
        if shape == 0:
            _boxes(rays, number, i, to_part, origin, parts.inside[i] != 0, depth, found)
        elif shape == 1:
            _ellipsoids(rays, number, i, to_part, origin, depth, found)
        elif shape == 2:
            _cylinders(rays, number, i, to_part, origin, depth, found)
        else:
            _gratings(rays, number, i, to_part, origin, parts.openings, depth, found)


@lean
def shade(rays, number, hits, frame, parts, bank, light, seen):
    """What rays (x, y, 1) see.

    Args:
        rays: (2, N) x and y on Z = 1, of which the first `number` count. hits: depth and part (N,), negative: nothing.
        frame, parts, bank, light: as in `shading.shade_ray`.
        seen: irradiance and tag (N,), written.
    """
    depth, found = hits
    irradiance, tags = seen
    for k in range(number):
        irradiance[k], tags[k] = SKY, NOTHING
        if found[k] >= 0:
            irradiance[k], tags[k] = shade_ray(
                rays[0, k], rays[1, k], depth[k], found[k], i32(-1), frame, parts, bank, light
            )


@jit
def cast(rays, placed, parts):
    """Depth (F, N) and part index (F, N), negative where nothing, of rays (2, N) on Z = 1, against every part."""
    frames, number = placed.to_part.shape[0], rays.shape[1]
    depth, found = np.empty((frames, number), np.float32), np.empty((frames, number), np.int32)
    everything = np.arange(len(parts.shape)).astype(np.int32)
    for f in range(frames):
        frame = placed.to_part[f], placed.origin[f], placed.light[f]
        trace(rays, number, frame, parts, everything, len(everything), depth[f], found[f])
    return depth, found
