"""A scene seen by a camera: intensity frames, and the exact truth."""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from evimo.geometry.camera import Camera
from evimo.recordings.truth import ObjectTruth, Truth
from evimo.scene.bodies import PackedScene, Scene
from evimo.recordings.flow import point_flow
from evimo.scene.kernels import cast, render

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]

# Rays within a pixel, as far as they go from its centre, px: the rotated grid of four.
WITHIN_PIXEL = ((0.125, 0.375), (-0.375, 0.125), (0.375, -0.125), (-0.125, -0.375))
COARSE = 4  # every COARSE-th pixel each way, for a quick look


class Frames:
    """Rendered frames.

    image: (F, H, W) linear irradiance, white is 1. depth: (F, H, W) z in m.
    parts: (F, H, W) int32 index of the part seen, negative where nothing.
    """

    __slots__ = ("depth", "image", "parts")

    def __init__(self, image: F4, depth: F4, parts: NDArray[np.int32]) -> None:
        self.image, self.depth, self.parts = image, depth, parts


class Renderer:
    """Casts rays through the sensor's own lens."""

    def __init__(self, scene: Scene, camera: Camera) -> None:
        self.scene, self.camera = scene, camera
        self.packed = PackedScene(scene)
        self.rays, self.valid = lens_rays(camera)

    def frames(self, time_s: F8) -> Frames:
        """Intensity, depth and parts at times (F,)."""
        image, depth, tags = render(
            self.rays,
            self.packed.placed(time_s),
            self.packed.parts,
            self.scene.bank,
            np.float32(self.scene.ambient),
            np.float32(1 / self.camera.fx),
        )
        return Frames(image, depth, tags.astype(np.int32) >> 3)

    @cached_property
    def coarse_rays(self) -> F4:
        """Rays (N, 2) of a coarse grid of pixels."""
        return np.ascontiguousarray(self.rays[0, COARSE // 2 :: COARSE, COARSE // 2 :: COARSE].reshape(-1, 2))

    def glance(self, time_s: F8) -> tuple[F4, NDArray[np.int32]]:
        """Depth (F, N) and part (F, N) of the coarse rays at times (F,)."""
        return cast(self.coarse_rays, self.packed.placed(time_s), self.packed.parts)

    def glance_flow(self, time_s: float) -> F8:
        """Image velocity (2, N) of the coarse rays, 1/s."""
        at = np.array([time_s])
        depth, parts = self.glance(at)
        ids = np.where(parts[0] >= 0, self.packed.ids[np.maximum(parts[0], 0)], 0).astype(np.uint8)
        ego, objects = self.motions(at)
        return point_flow(self.coarse_rays.T.astype(np.float64), depth[0], ids, (ego[0], objects[0]))

    def truth(self, t_us: int, frame: tuple[F4, NDArray[np.int32]] | None = None) -> Truth:
        """Everything about the instant t_us; `frame` gives depth and parts (H, W) where they are already rendered."""
        time_s = np.array([t_us * 1e-6])
        if frame is None:
            frames = self.frames(time_s)
            frame = frames.depth[0], frames.parts[0]
        depth, parts = frame
        seen = self.valid & (parts >= 0)
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
    """Rays (5, H, W, 2) on Z = 1 of every pixel's centre and of four points within it, and where the lens is defined."""
    centre = camera.pixels()
    offsets = np.array(((0.0, 0.0), *WITHIN_PIXEL))
    straight, known = camera.normalised(centre[None] + offsets[:, None, None])
    straight = np.where(known[..., None], straight, 0)
    return np.ascontiguousarray(straight, np.float32), known.all(axis=0)
