# pyright: basic
"""Frames of a moving scene, compiled: tiles that see little motion are cast less often and interpolated in time."""

import math

import numba
import numpy as np

from evimo.scene.rays.compiling import jit, lean, parallel
from evimo.scene.rays.tiles import MOST, NONE, ROWS, STRIDE, moment, shade, trace

f32 = np.float32
TILE = 16
_0, _1 = f32(0), f32(1)
_SLACK = f32(0.006)  # rad, added around a tile for safety


@lean
def tile_cones(rays, cones):
    """The cone around each tile: axis (unit, 3), cosine and sine of its half opening; `cones` (R, C, 5) is written."""
    height, width = rays.shape[2], rays.shape[3]
    for row in range(cones.shape[0]):
        for column in range(cones.shape[1]):
            y0, x0 = row * TILE, column * TILE
            y1, x1 = min(height, y0 + TILE) - 1, min(width, x0 + TILE) - 1
            cx, cy = rays[0, 0, (y0 + y1) // 2, (x0 + x1) // 2], rays[0, 1, (y0 + y1) // 2, (x0 + x1) // 2]
            norm, least = _1 / math.sqrt(cx * cx + cy * cy + _1), _1
            for s in range(len(rays)):
                for y in range(y0, y1 + 1):
                    for x in range(x0, x1 + 1):
                        dx, dy = rays[s, 0, y, x], rays[s, 1, y, x]
                        least = min(least, (dx * cx + dy * cy + _1) * norm / math.sqrt(dx * dx + dy * dy + _1))
            opening = math.acos(min(_1, least)) + _SLACK
            cone = cones[row, column]
            cone[0], cone[1], cone[2] = cx * norm, cy * norm, norm
            cone[3], cone[4] = math.cos(opening), math.sin(opening)


@lean
def bounding_spheres(centre, parts, pixel, spheres):
    """What tiles ask of each part's bounding sphere, (P, 6).

    Unit direction (3), cosine and sine of the angular radius (sine 2: it is everywhere), and 1 for a net with bars so
    thin that the rays through the pixels' centres could miss them.
    """
    for i in range(len(parts.shape)):
        x, y, z, radius = centre[i, 0], centre[i, 1], centre[i, 2], parts.radius[i]
        distance = math.sqrt(x * x + y * y + z * z)
        spheres[i, 4] = f32(2)
        if parts.shape[i] == 3:
            half, bars = parts.half[i], parts.openings[i]
            wide, high = half[0] / bars[0] * bars[2], half[1] / bars[1] * bars[3]
            thinnest = max(wide, high) if wide == _0 or high == _0 else min(wide, high)
            spheres[i, 5] = thinnest < f32(1.5) * pixel * distance
        if parts.inside[i] == 0 and distance > radius * f32(1.02):
            spheres[i, 0], spheres[i, 1], spheres[i, 2] = x / distance, y / distance, z / distance
            spheres[i, 4] = radius / distance
            spheres[i, 3] = math.sqrt(_1 - spheres[i, 4] * spheres[i, 4])


@lean
def parts_in_sight(cone, spheres, listed):
    """Parts whose sphere meets the cone; returns their number, and whether one of them is a fine net."""
    count, netted = 0, False
    for i in range(len(spheres)):
        cosine = cone[0] * spheres[i, 0] + cone[1] * spheres[i, 1] + cone[2] * spheres[i, 2]
        both = cone[3] * spheres[i, 3] - cone[4] * spheres[i, 4]  # cosine of the sum of both angles
        if spheres[i, 4] > _1 or cosine >= both:
            listed[count] = i
            count += 1
            netted = netted or spheres[i, 5] > _0
    return count, netted


@lean
def _look(f, number, scene, lists, scratch):
    """Cast and shade the first `number` rays of `scratch` at frame f."""
    _, placed, things, light = scene
    local, hits, seen, shaded, _ = scratch
    frame = moment(placed, f)
    trace(local, number, frame, things, lists, hits)
    shade(local, number, hits, frame, things, light, shaded, seen)


@lean
def _tile(f, box, scene, lists, out, scratch):
    """Cast the centre rays of one tile at frame f."""
    rays, (image, depth, tags) = scene[0], out
    local, (far, _, _), (irradiance, faces), _, _ = scratch
    y0, y1, x0, x1 = box
    number = NONE
    for y in range(y0, y1):
        for x in range(x0, x1):
            local[0, number], local[1, number] = rays[0, 0, y, x], rays[0, 1, y, x]
            number += 1
    _look(f, number, scene, (lists[0], lists[1]), scratch)
    k = 0
    for y in range(y0, y1):
        for x in range(x0, x1):
            image[f, y, x], depth[f, y, x], tags[f, y, x] = irradiance[k], far[k], faces[k]
            k += 1


@lean
def _smooth_edges(f, box, scene, lists, out, scratch):
    """Cast more rays in those pixels of a tile that see another face than a neighbour, or a fine net."""
    rays, (image, _, tags) = scene[0], out
    local, (irradiance, _), places, everywhere = scratch[0], scratch[2], scratch[4], lists[2]
    y0, y1, x0, x1 = box
    height, width, samples = image.shape[1], image.shape[2], rays.shape[0] - 1
    number = NONE
    for y in range(y0, y1):
        up, down = max(y - 1, 0), min(y + 1, height - 1)
        for x in range(x0, x1):
            tag, left, right = tags[f, y, x], max(x - 1, 0), min(x + 1, width - 1)
            edge = tags[f, y, left] != tag or tags[f, y, right] != tag
            if everywhere or edge or tags[f, up, x] != tag or tags[f, down, x] != tag:
                places[number // samples] = y * width + x
                for s in range(samples):
                    local[0, number], local[1, number] = rays[s + 1, 0, y, x], rays[s + 1, 1, y, x]
                    number += 1
    if number > 0:
        _look(f, number, scene, (lists[0], lists[1]), scratch)
    for place in range(number // samples):
        total = _0
        for k in range(place * samples, (place + 1) * samples):
            total += irradiance[k]
        image[f, places[place] // width, places[place] % width] = total / f32(samples)


@lean
def _interpolate(image, box, stride):
    """Fill the frames between those that were cast."""
    y0, y1, x0, x1 = box
    for f in range(1, image.shape[0]):
        if f % stride:
            before = f // stride * stride
            share = f32(f - before) / f32(stride)
            for y in range(y0, y1):
                for x in range(x0, x1):
                    first, last = image[before, y, x], image[before + stride, y, x]
                    image[f, y, x] = first + (last - first) * share


@lean
def _box(row, column, out):
    height, width = out[0].shape[1:]
    return row * TILE, min(height, row * TILE + TILE), column * TILE, min(width, column * TILE + TILE)


@jit
def _scratch(parts):
    hits = np.empty(MOST, np.float32), np.empty(MOST, np.int32), np.empty(MOST, np.int32)
    seen = np.empty(MOST, np.float32), np.empty(MOST, np.int32)
    casters, owner, left = np.empty(len(parts.casters), np.int32), np.empty(MOST, np.int32), np.empty(MOST, np.float32)
    shaded = casters, owner, left, np.empty(MOST, np.int32), np.empty(ROWS * STRIDE, np.float32)
    return np.empty((2, MOST), np.float32), hits, seen, shaded, np.empty(TILE * TILE, np.int32)


@jit
def _cast_row(row, first, cones, strides, scene, spheres, lists, out):
    scratch, tags = _scratch(scene[2][0]), out[2]
    for column in range(cones.shape[1]):
        y0, y1, x0, x1 = box = _box(row, column, out)
        for f in range(first, len(spheres)):
            if f % strides[row, column]:
                tags[f, y0:y1, x0:x1] = tags[f - 1, y0:y1, x0:x1]
                continue
            found = lists[0][row, column, f]
            count, net = parts_in_sight(cones[row, column], spheres[f], found)
            lists[1][row, column, f], lists[2][row, column, f] = count, net
            _tile(f, box, scene, (found, count, net), out, scratch)


@jit
def _smooth_row(row, first, strides, scene, lists, out):
    scratch = _scratch(scene[2][0])
    for column in range(strides.shape[1]):
        box, stride = _box(row, column, out), strides[row, column]
        for f in range(first, len(out[0])):
            if f % stride == 0:
                count = np.int64(lists[1][row, column, f])  # as `parts_in_sight` has it: what follows is compiled once
                mine = lists[0][row, column, f], count, lists[2][row, column, f]
                _smooth_edges(f, box, scene, mine, out, scratch)
        if stride > 1:
            _interpolate(out[0], box, stride)


@parallel
def render(cones, rays, placed, parts, bank, meshes, light, strides, first, image, depth, tags):
    """Frames through a lens.

    Args:
        cones: of `tile_cones`.
        rays: (1 + S, 2, H, W), the ray of each pixel's centre on Z = 1, then S rays within it, cast only at edges.
        placed: the scene at F times, `bodies.Placed`. parts, bank, meshes, light: as in `shading.shade_ray`.
        strides: (R, C) per tile: it is cast in every so many frames; F - 1 is a multiple of each.
        first: the first frame to cast; those before are given.
        image, depth, tags: written. Irradiance (F, H, W), depth (F, H, W), tags (F, H, W) int16: part * 8 + face of
            the centre ray. Depth is written only where a tile is cast.
    """
    frames, (rows, columns) = len(image), strides.shape
    listed = np.empty((rows, columns, frames, len(parts.shape)), np.uint8)
    counts, nets = np.zeros((rows, columns, frames), np.int32), np.zeros((rows, columns, frames), np.bool_)
    spheres = np.zeros((frames, len(parts.shape), 6), np.float32)
    for f in range(frames):
        bounding_spheres(placed.centre[f], parts, light[1], spheres[f])
    for row in numba.prange(rows):  # parallel loops take neither nested tuples nor writes to a tuple's arrays
        scene, lists = (rays, placed, (parts, bank, meshes), light), (listed, counts, nets)
        _cast_row(row, first, cones, strides, scene, spheres, lists, (image, depth, tags))
    for row in numba.prange(rows):
        scene, lists = (rays, placed, (parts, bank, meshes), light), (listed, counts, nets)
        _smooth_row(row, first, strides, scene, lists, (image, depth, tags))
