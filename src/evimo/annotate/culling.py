# pyright: basic
"""What of a scan may be in view, and how fine it is drawn: questions of balls around parts of it, compiled."""

import math
from pathlib import Path

from evimo.scene.rays.compiling import compiler

NEAR = 0.01  # m; what is nearer to the camera is not drawn

_compiled = compiler(Path(__file__).parent, ("culling",))
inlined = _compiled(_nrt=False, forceinline=True)


@inlined
def moved(pose, x, y, z):
    """A point in camera axes."""
    return (
        pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3],
        pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3],
        pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z + pose[2, 3],
    )


@inlined
def in_view(ball, pose, bounds):
    """Whether a ball may be in the image."""
    x, y, z = moved(pose, ball[0], ball[1], ball[2])
    left, right, top, bottom, reach = bounds[0], bounds[1], bounds[2], bounds[3], ball[3]
    return (
        z + reach > NEAR
        and x - left * z > -reach * math.sqrt(1 + left * left)
        and x - right * z < reach * math.sqrt(1 + right * right)
        and y - top * z > -reach * math.sqrt(1 + top * top)
        and y - bottom * z < reach * math.sqrt(1 + bottom * bottom)
    )


@inlined
def level_of(surfaces, chunk, pose, finest):
    """The coarsest level of a chunk whose discs have a radius of at most `finest` on the plane Z = 1."""
    ball = surfaces.chunk_balls[chunk]
    x, y, z = moved(pose, ball[0], ball[1], ball[2])
    near = max(math.sqrt(x * x + y * y + z * z) - ball[3], NEAR)
    level = surfaces.chunks[chunk, 2] - 1
    while level > surfaces.chunks[chunk, 1] and surfaces.sizes[level] > finest * near:
        level -= 1
    return level
