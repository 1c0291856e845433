# pyright: basic
"""What stands in the light: soft shadows of ellipsoids, scalar functions, float32, for both processors.

The light is a disc at infinity. Every caster throws the shadow of an ellipsoid about as large; in the space where that
is the unit sphere, the share of the disc that it hides follows from how far the ray to the light passes by its centre.
`shadow_rows` does once per frame what all rays have in common: a row of ROW numbers for each caster.
"""

import math

import numpy as np

from evimo.scene.rays.compiling import lean

f32 = np.float32
_0, _HALF, _1, _2, _3 = f32(0), f32(0.5), f32(1), f32(2), f32(3)
_TINY = f32(1e-9)
ROW = 16


def shadow_rows(to_unit, origin, sun, lamp):
    """Rows (F, Q, ROW) of Q casters.

    A row takes a point in camera axes, m, to u and v, across the light, and to how far the centre lies ahead towards
    the light, all in the space where the caster is the unit sphere: three rows of a matrix, each with its offset. Then
    what the half shadow's width squared is per u², 2 u v, v² and squared way ahead; the largest of these over all
    directions, as a root.

    Args:
        to_unit: (F, Q, 3, 3) and origin: (F, Q, 3): camera axes to that space.
        sun: (F, 3) unit, to the light. lamp: the light's angular radius, rad.
    """
    towards = np.einsum("fqij,fj->fqi", to_unit, sun)
    per_m = np.linalg.norm(towards, axis=-1)
    towards = towards / per_m[..., None]
    other = np.eye(3)[np.abs(towards).argmin(-1)]
    u = np.cross(towards, other)
    u /= np.linalg.norm(u, axis=-1, keepdims=True)
    axes = np.stack((u, np.cross(towards, u), -towards), axis=-2)  # (F, Q, 3, 3)
    matrix, offset = axes @ to_unit, np.einsum("fqij,fqj->fqi", axes, origin)
    wider = matrix[..., :2, :] @ matrix[..., :2, :].swapaxes(-1, -2) * (lamp / per_m[..., None, None]) ** 2
    steepest = np.sqrt(np.linalg.eigvalsh(wider)[..., 1])
    rows = (
        np.concatenate((matrix, offset[..., None]), axis=-1).reshape(*per_m.shape, 12),
        np.stack((wider[..., 0, 0], wider[..., 0, 1], wider[..., 1, 1]), axis=-1),
        steepest[..., None],
    )
    return np.concatenate(rows, axis=-1)


@lean
def _across(row, k, px, py, pz):
    return row[k] * px + row[k + 1] * py + row[k + 2] * pz + row[k + 3]


@lean
def _widest(row, k, x, y, z):
    return abs(row[k]) * x + abs(row[k + 1]) * y + abs(row[k + 2]) * z


@lean
def may_shade(row, middle, half):
    """Whether a caster may stand between the light and any point of a box: its middle, half sizes, camera axes, m."""
    (px, py, pz), (x, y, z) = middle, half
    u = max(_0, abs(_across(row, 0, px, py, pz)) - _widest(row, 0, x, y, z))
    v = max(_0, abs(_across(row, 4, px, py, pz)) - _widest(row, 4, x, y, z))
    furthest = _across(row, 8, px, py, pz) + _widest(row, 8, x, y, z)
    reach = _1 + row[15] * furthest
    return furthest > _0 and u * u + v * v < reach * reach


@lean
def hidden_share(row, px, py, pz):
    """Share of the light that a caster hides from a point in camera axes, m; without branches, like `hits`."""
    u, v, ahead = _across(row, 0, px, py, pz), _across(row, 4, px, py, pz), _across(row, 8, px, py, pz)
    square = u * u + v * v
    wider = u * u * row[12] + _2 * u * v * row[13] + v * v * row[14] + _TINY * row[12]
    half_shadow = max(ahead * math.sqrt(wider / (square + _TINY)), _TINY)
    per_half = _1 / half_shadow
    edge = min(_1, max(_0, _HALF * max(per_half, _1) * (_1 + half_shadow - math.sqrt(square))))
    share = edge * edge * (_3 - _2 * edge) * min(_1, per_half) * min(_1, per_half)
    return share if ahead > _0 else _0
