"""A scene seen by a camera: intensity frames, and the exact truth."""

import math
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from evimo.geometry.camera import Camera
from evimo.recordings.flow import point_flow
from evimo.recordings.truth import ObjectTruth, Truth
from evimo.scene.bodies import PackedScene, Parts, Scene
from evimo.scene.meshes.bank import MeshBank
from evimo.scene.rays.film import TILE, render, tile_cones
from evimo.scene.rays.tiles import cast
from evimo.scene.textures.bank import TextureBank

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]

# Rays within a pixel, as far as they go from its centre, px: the rotated grid of four.
WITHIN_PIXEL = ((0.125, 0.375), (-0.375, 0.125), (0.375, -0.125), (-0.125, -0.375))
COARSE = 4  # every COARSE-th pixel each way, for a quick look
MARGIN = 8  # px around a tile whose motion counts for it


class Frames(NamedTuple):
    """Rendered frames.

    image: (F, H, W) linear irradiance, white is 1. depth: (F, H, W) z in m.
    tags:  (F, H, W) int16, 8 * part + face seen by the pixel's centre, negative where nothing.
    """

    image: F4
    depth: F4
    tags: NDArray[np.int16]

    def seen(self, frame: int) -> tuple[F4, NDArray[np.int16]]:
        """Depth and part (H, W) of one frame."""
        return self.depth[frame], self.tags[frame] >> 3


class Renderer:
    """Casts rays through the sensor's own lens."""

    def __init__(self, scene: Scene, camera: Camera) -> None:
        self.scene, self.camera = scene, camera
        self.packed = PackedScene(scene)

    @cached_property
    def lens(self) -> tuple[F4, NDArray[np.bool_]]:
        """Rays (5, 2, H, W) of every pixel's centre and of points within it, and where the lens is defined (H, W)."""
        return lens_rays(self.camera)

    @cached_property
    def cones(self) -> F4:
        """The cone around each tile, (R, C, 5)."""
        cones = np.empty((math.ceil(self.camera.height / TILE), math.ceil(self.camera.width / TILE), 5), np.float32)
        tile_cones(self.lens[0], cones)
        return cones

    def frames(self, time_s: F8) -> Frames:
        """Intensity, depth and parts at times (F,)."""
        frames = self._empty(len(time_s))
        self._render(time_s, np.ones(self.cones.shape[:2], np.int32), 0, frames)
        return frames

    def film(self, time_s: F8, strides: NDArray[np.int32], last: Frames) -> Frames:
        """Frames at times (F,), going on from the last frame of `last`, which is at time_s[0].

        strides: (R, C), each tile is cast in every so many frames and interpolated between; F - 1 is a multiple. Depth
        is known in frames that are multiples of every stride.
        """
        frames = self._empty(len(time_s))
        for new, old in zip(frames, last, strict=True):
            new[0] = old[-1]
        self._render(time_s, strides, 1, frames)
        return frames

    def _empty(self, count: int) -> Frames:
        shape = (count, *self.camera.size)
        return Frames(np.empty(shape, np.float32), np.empty(shape, np.float32), np.empty(shape, np.int16))

    def _render(self, time_s: F8, strides: NDArray[np.int32], first: int, out: Frames) -> None:
        render(self.cones, self.lens[0], self.packed.placed(time_s), *self.things, self.light, strides, first, *out)

    @property
    def things(self) -> tuple[Parts, TextureBank, MeshBank]:
        """What the kernels take for the scene, apart from where its parts are."""
        return self.packed.parts, self.scene.bank, self.scene.meshes

    @property
    def light(self) -> F4:
        """Share of light without direction; size of a pixel on Z = 1, (2,)."""
        return np.array((self.scene.ambient, 1 / self.camera.fx), np.float32)

    @cached_property
    def coarse_rays(self) -> F4:
        """Rays (2, N) of a coarse grid of pixels."""
        some = self.camera.pixels()[COARSE // 2 :: COARSE, COARSE // 2 :: COARSE].reshape(-1, 2)
        straight, known = self.camera.normalised(some)
        return np.ascontiguousarray(np.where(known[:, None], straight, 0).T, np.float32)

    @property
    def coarse_size(self) -> tuple[int, int]:
        """Rows and columns of that grid."""
        height, width = self.camera.size
        return len(range(COARSE // 2, height, COARSE)), len(range(COARSE // 2, width, COARSE))

    def glance(self, time_s: F8) -> tuple[F4, NDArray[np.int32]]:
        """Depth (F, N) and part (F, N) of the coarse rays at times (F,)."""
        return cast(self.coarse_rays, self.packed.placed(time_s), self.things)

    def glance_flow(self, time_s: float) -> F8:
        """Image velocity (2, N) of the coarse rays, 1/s."""
        at = np.array([time_s])
        depth, parts = self.glance(at)
        ids = np.where(parts[0] >= 0, self.packed.ids[np.maximum(parts[0], 0)], 0).astype(np.uint8)
        ego, objects = self.motions(at)
        return point_flow(self.coarse_rays.astype(np.float64), depth[0], ids, (ego[0], objects[0]))

    def by_tile(self, values: F8) -> F8:
        """The largest value (N,) of the coarse rays in each tile or within MARGIN of it, (R, C)."""
        each = TILE // COARSE
        grid: F8 = maximum_filter(values.reshape(self.coarse_size), 2 * MARGIN // COARSE + 1, mode="nearest")
        rows, columns = self.cones.shape[:2]
        short = ((0, rows * each - grid.shape[0]), (0, columns * each - grid.shape[1]))
        tiles = np.pad(grid, short, mode="edge").reshape(rows, each, columns, each)
        return tiles.max(axis=(1, 3))

    def truth(self, t_us: int, frame: tuple[F4, NDArray[np.int16]] | None = None) -> Truth:
        """Everything about the instant t_us; `frame` gives depth and parts (H, W) where they are already rendered."""
        time_s = np.array([t_us * 1e-6])
        if frame is None:
            frame = self.frames(time_s).seen(0)
        depth, parts = frame
        seen = self.lens[1] & (parts >= 0)
        index = np.maximum(parts, 0)
        ids = np.where(seen, self.packed.ids[index], 0).astype(np.uint8)
        clutter = np.where(seen, self.packed.clutter[index], 0).astype(np.uint8)
        ego, objects = self.motions(time_s)
        depth = np.where(seen, depth, 0).astype(np.float32)
        return Truth(t_us, depth, seen, ids, clutter > 0, ego[0], objects[0])

    def motions(self, time_s: F8) -> tuple[F8, list[dict[int, ObjectTruth]]]:
        """The camera's twists (F, 6), and each mover's motion at every time, camera axes."""
        camera = self.scene.camera.at(time_s)
        cam_from_world = camera.rotation.swapaxes(-1, -2)
        ego = np.concatenate((np.einsum("fij,fj->fi", cam_from_world, camera.velocity), camera.spin), axis=1)
        objects: list[dict[int, ObjectTruth]] = [{} for _ in ego]
        for id_, body in enumerate(self.scene.movers, 1):
            assert body.motion is not None
            poses = body.motion.at(time_s)
            offset = np.einsum("fij,fj->fi", cam_from_world, poses.position - camera.position)
            velocity = np.einsum("fij,fj->fi", cam_from_world, poses.velocity)
            rotation = np.einsum("fij,fjk,fk->fi", cam_from_world, poses.rotation, poses.spin)
            for frame, moved in enumerate(zip(offset, velocity, rotation, strict=True)):
                objects[frame][id_] = ObjectTruth(*moved)
        return ego, objects


def lens_rays(camera: Camera) -> tuple[F4, NDArray[np.bool_]]:
    """Rays (5, 2, H, W) on Z = 1 of each pixel's centre and of four points within it; where the lens is defined."""
    centre = camera.pixels()
    offsets = np.array(((0.0, 0.0), *WITHIN_PIXEL))
    straight, known = camera.normalised(centre[None] + offsets[:, None, None])
    straight = np.where(known[..., None], straight, 0)
    return np.ascontiguousarray(np.moveaxis(straight, -1, 1), np.float32), np.logical_and.reduce(known)
