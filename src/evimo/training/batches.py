"""Batches for training: what the networks see, truth beside it, in the rectified image. Torch."""

from collections.abc import Callable
from typing import NamedTuple

import torch
from torch import Tensor

from evimo.geometry.warping import EventPoints


class Batch(NamedTuple):
    """B samples of one size (H, W); truth is at the centre of the middle slice, at half the size (h, w).

    voxels:      (B, 30, h, w) of the events as they come; fits: (B, 24, h, w) of the same (`events.stack`).
    candidates:  (B, 22, h/2, w/2) of local motion (`events.local_motion`).
    sharp_voxels: (B, 30, H, W) of the compensated events; sharp_fits: (B, 24, h, w).
    taken_ego:   (B, 6) the twist that was taken out at the middle slice, mean depths and rad per slice.
    taken_depth: (B, 1, h/2, w/2) the relative depth that was used for it.
    rotation:    (B, 4) of a gyroscope, rad per slice, and 1; or zeros.
    valid:       (B, 1, h, w) float, share of the pixel that the lens sees.
    intrinsics:  (B, 4) fx fy cx cy of the image (H, W), px.
    depth:       (B, 1, h, w) m; meaningless where not `depth_valid`.
    depth_valid: (B, 1, h, w) bool; elsewhere nothing is known of the pixel but whether it moves.
    moving:      (B, 1, h, w) bool, pixels of objects that move.
    flow:        (B, 2, h, w) 1/s on the plane Z = 1.
    velocity:    (B, 3, h, w) of the object the pixel shows, relative to the static world, camera axes, m/s.
    ego:         (B, 6) the camera's twist, m/s and rad/s.
    events:      those of the middle slices, in px of the image (H, W), t in s relative to the slice's centre; None
        where no loss wants them.
    """

    voxels: Tensor
    fits: Tensor
    candidates: Tensor
    sharp_voxels: Tensor
    sharp_fits: Tensor
    taken_ego: Tensor
    taken_depth: Tensor
    rotation: Tensor
    valid: Tensor
    intrinsics: Tensor
    depth: Tensor
    depth_valid: Tensor
    moving: Tensor
    flow: Tensor
    velocity: Tensor
    ego: Tensor
    events: EventPoints | None = None

    def to(self, device: torch.device) -> "Batch":
        """The same batch on a device; from pinned memory, without waiting for it."""
        return self._each(lambda tensor: tensor.to(device, non_blocking=True))

    def pinned(self) -> "Batch":
        """The same batch in memory that a GPU reads by itself."""
        return self._each(Tensor.pin_memory)

    def _each(self, change: Callable[[Tensor], Tensor]) -> "Batch":
        tensors = [change(tensor) for tensor in self[:16]]
        events = None if self.events is None else EventPoints(*(change(column) for column in self.events))
        return Batch(*tensors, events=events)
