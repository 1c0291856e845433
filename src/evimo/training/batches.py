"""Batches for training: frames in, truth beside them, in the rectified image. Torch."""

from typing import NamedTuple

from torch import Tensor

from evimo.geometry.warping import EventPoints


class Batch(NamedTuple):
    """B samples of one size; truth is at the centre of the middle slice.

    frames:      (B, N, 3, H, W) event frames, N slices.
    valid:       (B, 1, H, W) float, 1 where the lens sees the pixel.
    intrinsics:  (B, 4) fx fy cx cy of the rectified image, px.
    depth:       (B, 1, H, W) m; meaningless where not `depth_valid`.
    depth_valid: (B, 1, H, W) bool.
    moving:      (B, 1, H, W) bool, pixels of objects that move.
    flow:        (B, 2, H, W) 1/s on the plane Z = 1.
    velocity:    (B, 3, H, W) of the object the pixel shows, relative to the static world, camera axes, m/s.
    ego:         (B, 6) the camera's twist, m/s and rad/s.
    events:      those of the middle slices, in px of the rectified image, t in s relative to the slice's centre; None
        where no loss wants them.
    """

    frames: Tensor
    valid: Tensor
    intrinsics: Tensor
    depth: Tensor
    depth_valid: Tensor
    moving: Tensor
    flow: Tensor
    velocity: Tensor
    ego: Tensor
    events: EventPoints | None = None

    def to(self, device: str) -> "Batch":
        """The same batch on a device."""
        tensors = [tensor.to(device) for tensor in self[:9]]
        events = None if self.events is None else EventPoints(*(column.to(device) for column in self.events))
        return Batch(*tensors, events=events)
