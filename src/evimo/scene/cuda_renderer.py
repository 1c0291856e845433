# pyright: basic
"""The renderer on an NVIDIA GPU: every tile is cast in every frame, as on the CPU with strides of 1."""

from typing import Any

import numpy as np

from evimo.scene.rays.cuda import LISTING, Lists, bound, cast_centres, fill_lists, smooth_edges
from evimo.scene.rays.film import TILE
from evimo.scene.rays.on_device import THREADS, blocks, cuda, uploaded
from evimo.scene.renderer import Frames, Renderer


class CudaRenderer:
    """Casts rays as `Renderer` does, on the GPU."""

    def __init__(self, renderer: Renderer) -> None:
        scene = renderer.scene
        self.renderer = renderer
        self._cones, self._rays = cuda.to_device(renderer.cones), cuda.to_device(renderer.lens[0])
        self._parts, self._bank = uploaded(renderer.packed.parts), _on_gpu(scene.bank)
        self._meshes, self._light = uploaded(scene.meshes), cuda.to_device(renderer.light)

    def frames(self, time_s: np.ndarray) -> Frames:
        """Intensity, depth and parts at times (F,), on the GPU."""
        shape = (len(time_s), *self.renderer.camera.size)
        frames = Frames(*(cuda.device_array(shape, kind) for kind in (np.float32, np.float32, np.int16)))
        placed = uploaded(self.renderer.packed.placed(time_s))
        lists = self._lists(placed, len(time_s))
        rows, columns = self._cones.shape[:2]
        tiles = (columns, rows, len(time_s)), (TILE, TILE)
        scene = placed, (self._parts, self._bank, self._meshes), self._light
        cast_centres[tiles](self._rays, *scene, lists, *frames)
        smooth_edges[tiles](self._rays, *scene, lists, frames.image, frames.tags)
        return frames

    def _lists(self, placed: Any, frames: int) -> Lists:
        rows, columns = self._cones.shape[:2]
        number = len(self._parts.shape)
        spheres = cuda.to_device(np.zeros((frames, number, 6), np.float32))
        bound[blocks(frames), THREADS](placed.centre, self._parts, self._light, spheres)
        lists = Lists(
            cuda.device_array((rows, columns, frames, number), np.uint8),
            cuda.device_array((rows, columns, frames), np.int32),
            cuda.device_array((rows, columns, frames), np.bool_),
        )
        grid = tuple(-(-number // each) for number, each in zip((columns, rows, frames), LISTING, strict=True))
        fill_lists[grid, LISTING](self._cones, spheres, lists)
        return lists


_banks: dict[int, tuple[Any, Any]] = {}


def _on_gpu(bank: Any) -> Any:
    """A texture bank on the GPU; the last one is kept, since many recordings share it."""
    if id(bank) not in _banks:
        _banks.clear()
        _banks[id(bank)] = bank, uploaded(bank)
    return _banks[id(bank)][1]
