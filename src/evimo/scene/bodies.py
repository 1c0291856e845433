"""What a scene is made of: parts with surfaces, grouped in bodies that move rigidly."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evimo.scene.meshes.bank import NO_MESHES, MeshBank
from evimo.scene.motion import Motion
from evimo.scene.rays.shadows import shadow_rows
from evimo.scene.textures.bank import TextureBank

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]

BOX, ELLIPSOID, CYLINDER, GRATING, MESH = 0, 1, 2, 3, 4
MOST_PARTS = 120  # in a scene; the renderer's lists of them are uint8
STOUT = 1.24  # half sizes of a box times this are those of an ellipsoid as large, which throws its shadow


@dataclass(frozen=True, slots=True)
class Surface:
    """What a part looks like.

    texture: index in the bank. period: of the texture on the surface, m. shift: (2,) periods.
    dark, bright: reflectance where the texture is 0 and 1. gloss: irradiance of a highlight's middle.
    """

    texture: int
    period: float
    shift: tuple[float, float]
    dark: float
    bright: float
    gloss: float = 0.0


@dataclass(frozen=True, slots=True)
class Part:
    """One primitive of a body.

    shape:    BOX, ELLIPSOID, CYLINDER (axis z), GRATING: a flat net in its plane z = 0, or MESH: triangles.
    half:     (3,) half sizes, m. position: (3,), rotation: (3, 3), body_from_part.
    inside:   seen from within: the room.
    openings: of a GRATING: bars per half size in x and y, and the share of the pitch that is bar, in x and y.
    mesh:     of a MESH: which of the scene's; all three half sizes are half its longest length.
    """

    shape: int
    half: F8
    position: F8
    rotation: F8
    surface: Surface
    inside: bool = False
    openings: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    mesh: int = -1


@dataclass(frozen=True, slots=True)
class Body:
    """Parts that move together; without motion they stand in the world.

    clutter: drawn like the movers, but static. kind: of toy, if it is one of `toys.KINDS`.
    """

    parts: tuple[Part, ...]
    motion: Motion | None = None
    clutter: bool = False
    kind: str = ""


@dataclass(frozen=True, slots=True)
class Scene:
    """A room, clutter, movers, a camera's way through it, and light.

    bodies:  the first is the room; movers have the ids 1 to K in their order, every static body has id 0.
    light:   (3,) unit vector to the light, world axes. ambient: share of light without direction.
    lamp:    angular radius of the light, rad; with 0 nothing throws a shadow. Otherwise all bodies but the first do.
    room:    its kind, where that is known.
    """

    bodies: tuple[Body, ...]
    camera: Motion
    light: F8
    ambient: float
    bank: TextureBank
    meshes: MeshBank = NO_MESHES
    lamp: float = 0.0
    room: str = ""

    @property
    def movers(self) -> tuple[Body, ...]:
        """Bodies that move on their own."""
        return tuple(body for body in self.bodies if body.motion is not None)


class Parts(NamedTuple):
    """All parts of a scene as arrays of P rows, for the kernels.

    body: of each part. casters: (Q,) the parts that throw shadows.
    """

    shape: NDArray[np.int32]
    inside: NDArray[np.int32]
    texture: NDArray[np.int32]
    period: F4
    shift: F4
    reflectance: F4
    half: F4
    openings: F4
    radius: F4
    gloss: F4
    mesh: NDArray[np.int32]
    body: NDArray[np.int32]
    casters: NDArray[np.int32]


class Placed(NamedTuple):
    """Parts as seen by the camera at F times.

    to_part: (F, P, 3, 3) and origin: (F, P, 3): camera axes to the part's unit space, where it reaches from -1 to 1;
             a ray (x, y, 1) keeps its parameter, which is depth.
    light:   (F, P, 3) direction to the light in the part's axes. centre: (F, P, 3) of the part in camera axes.
    shadows: (F, Q, ROW) of `shadows.shadow_rows`: the shadow of each caster.
    """

    to_part: F4
    origin: F4
    light: F4
    centre: F4
    shadows: F4


class PackedScene:
    """A scene as arrays: constant ones once, moving ones for any times."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        parts = [part for body in scene.bodies for part in body.parts]
        if len(parts) > MOST_PARTS:
            raise ValueError(f"{len(parts)} parts in a scene, at most {MOST_PARTS}")
        ids, movers = [], 0
        for body in scene.bodies:
            movers += body.motion is not None
            ids += [movers if body.motion is not None else 0] * len(body.parts)
        self.ids = np.array(ids, np.uint8)
        clutter = np.cumsum([body.clutter for body in scene.bodies])
        numbers = [int(n) if body.clutter else 0 for n, body in zip(clutter, scene.bodies, strict=True)]
        self.clutter = np.repeat(np.array(numbers, np.uint8), [len(body.parts) for body in scene.bodies])
        self.position = np.stack([part.position for part in parts])
        self.rotation = np.stack([part.rotation for part in parts])
        self.parts = _as_arrays(scene)
        self.stout = np.stack([_stout(parts[i], scene.meshes) for i in self.parts.casters] or [np.empty(3)])

    def placed(self, time_s: F8) -> Placed:
        """Parts in camera axes at times (F,)."""
        camera = self.scene.camera.at(time_s)
        rotation = np.tile(self.rotation, (len(camera.position), 1, 1, 1))
        position = np.tile(self.position, (len(camera.position), 1, 1))
        for id_, body in enumerate(self.scene.movers, 1):
            assert body.motion is not None
            poses, mine = body.motion.at(time_s), np.flatnonzero(self.ids == id_)
            rotation[:, mine] = poses.rotation[:, None] @ self.rotation[mine]
            position[:, mine] = poses.position[:, None] + np.einsum("fij,pj->fpi", poses.rotation, self.position[mine])
        part_from_world = rotation.swapaxes(-1, -2)
        scale = 1 / self.parts.half.astype(np.float64)
        offset = camera.position[:, None] - position
        to_part = scale[..., None] * (part_from_world @ camera.rotation[:, None])
        origin = scale * np.einsum("fpij,fpj->fpi", part_from_world, offset)
        light = part_from_world @ self.scene.light
        centre = np.einsum("fji,fpj->fpi", camera.rotation, -offset)
        sun, casters = np.einsum("fji,j->fi", camera.rotation, self.scene.light), self.parts.casters
        bodies = to_part[:, casters] / self.stout[..., None], origin[:, casters] / self.stout
        shadows = shadow_rows(*bodies, sun, self.scene.lamp)
        return Placed(*(np.ascontiguousarray(a, np.float32) for a in (to_part, origin, light, centre, shadows)))


def _as_arrays(scene: Scene) -> Parts:
    parts = [part for body in scene.bodies for part in body.parts]
    half = np.stack([part.half for part in parts])
    shape, mesh = (np.array(values, np.int32) for values in zip(*((p.shape, p.mesh) for p in parts), strict=True))
    body = np.repeat(np.arange(len(scene.bodies)), [len(body.parts) for body in scene.bodies])
    surfaces = [part.surface for part in parts]
    casts = (body > 0) & (shape != GRATING) & (scene.lamp > 0)
    return Parts(
        shape=shape,
        inside=np.array([part.inside for part in parts], np.int32),
        texture=np.array([surface.texture for surface in surfaces], np.int32),
        period=np.array([surface.period for surface in surfaces], np.float32),
        shift=np.array([surface.shift for surface in surfaces], np.float32),
        reflectance=np.array([(surface.dark, surface.bright) for surface in surfaces], np.float32),
        half=half.astype(np.float32),
        openings=np.array([part.openings for part in parts], np.float32),
        radius=np.array([_radius(part, scene.meshes) for part in parts], np.float32),
        gloss=np.array([surface.gloss for surface in surfaces], np.float32),
        mesh=mesh,
        body=body.astype(np.int32),
        casters=np.flatnonzero(casts).astype(np.int32),
    )


def _radius(part: Part, meshes: MeshBank) -> float:
    """Of the sphere around a part, m."""
    a, b, c = part.half
    reach = {
        BOX: math.hypot(a, b, c),
        ELLIPSOID: max(a, b, c),
        CYLINDER: math.hypot(max(a, b), c),
        GRATING: math.hypot(a, b),
    }
    return a * float(meshes.radius[part.mesh]) if part.shape == MESH else reach[part.shape]


def _stout(part: Part, meshes: MeshBank) -> F8:
    """Half sizes of the ellipsoid that throws a part's shadow, in the part's unit space, (3,)."""
    if part.shape == MESH:
        return STOUT * meshes.extent[part.mesh].astype(np.float64)
    return np.full(3, STOUT if part.shape == BOX else 1.0) if part.shape != CYLINDER else np.array((1.07, 1.07, 1.15))
