"""Depth network and pose network joined by the geometry of the paper."""

from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import pad

from evimo.geometry.grids import normalised_grid, resized_intrinsics
from evimo.geometry.motion_field import motion_field, pixel_twist
from evimo.model.backbone import reduced
from evimo.model.depth_net import DepthNet
from evimo.model.evidence import Evidence, evidence
from evimo.model.pose_net import Geometry, PoseNet
from evimo.model.presets import ModelConfig

SLICES_PER_S = 40.0  # a slice lasts 25 ms


class Prediction(NamedTuple):
    """The model's answer at one scale, valid at the centre of the middle slice.

    rel_depth:  (B, 1, h, w) mean 1 over the valid pixels.
    ego:        (B, 6) mean depths per second and rad/s.
    residual:   (B, C, 3) mean depths per second.
    mixture:    (B, C+1, h, w).
    seen:       (B, 2, h, w) the flow the pose network sees, 1/s on the plane Z = 1; it takes no part in the answer.
    intrinsics: (B, 4) fx fy cx cy of this scale, px.
    valid:      (B, 1, h, w) share of the pixel that the lens sees.
    """

    rel_depth: Tensor
    ego: Tensor
    residual: Tensor
    mixture: Tensor
    seen: Tensor
    intrinsics: Tensor
    valid: Tensor

    @property
    def flow(self) -> Tensor:
        """(B, 2, h, w) by equations 1 and 2, in 1/s on the plane Z = 1."""
        grid = normalised_grid(self.intrinsics, self.rel_depth)
        return motion_field(pixel_twist(self.ego, self.residual, self.mixture), 1 / self.rel_depth, grid)

    @property
    def object_velocity(self) -> Tensor:
        """(B, 3, h, w) of each pixel if it moves: minus its residual translation, mean depths per second."""
        share = self.mixture[:, 1:] / (self.mixture[:, 1:].sum(1, keepdim=True) + 1e-6)
        return -torch.einsum("bcd,bchw->bdhw", self.residual, share)


def mean_one(depth: Tensor, valid: Tensor) -> Tensor:
    """Depth divided by its mean over the valid pixels."""
    total = (depth * valid).sum((1, 2, 3), keepdim=True)
    return depth * (valid.sum((1, 2, 3), keepdim=True) + 1e-6) / (total + 1e-6)


def at_half_size(frames: Float[Tensor, "B N 3 H W"]) -> tuple[Tensor, Tensor]:
    """Log counts (B, N, 2, h, w) and mean times about each slice's centre (B, N, h, w), at half the size."""
    occupied = frames[:, :, :2].sum(2).clamp(max=1)
    counts = reduced(frames[:, :, :2].flatten(1, 2), 2).log1p()
    return counts.unflatten(1, (-1, 2)), reduced(frames[:, :, 2] - 0.5 * occupied, 2)


class MotionNet(nn.Module):
    """Frames of five slices in; depth, egomotion, mixture and residual translations out, at every scale."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self.config = config
        self.depth_net = DepthNet(config, 3 + 1 + 2 * config.coordinates)
        self.pose_net = PoseNet(config, 3 * config.slices + 1)

    def forward(
        self,
        frames: Float[Tensor, "B N 3 H W"],
        valid: Float[Tensor, "B 1 H W"],
        intrinsics: Float[Tensor, "B 4"],
    ) -> list[Prediction]:
        """From the coarsest to the finest scale; the finest has half the padded image's size.

        Args:
            frames: event frames around the middle slice; a missing one is zero.
            valid: 1 where the lens sees the pixel, else 0.
            intrinsics: fx fy cx cy of the rectified image, px.
        """
        stride = self.config.stride
        right, down = -frames.shape[-1] % stride, -frames.shape[-2] % stride
        return self.padded(pad(frames, (0, right, 0, down)), pad(valid, (0, right, 0, down)), intrinsics)

    def padded(
        self,
        frames: Float[Tensor, "B N 3 H W"],
        valid: Float[Tensor, "B 1 H W"],
        intrinsics: Float[Tensor, "B 4"],
    ) -> list[Prediction]:
        """As `forward`, of images whose sides are multiples of the configuration's stride."""
        counts, times = at_half_size(frames)
        image = torch.cat((counts.flatten(1, 2), times), dim=1)
        return self.answers(image, evidence(counts, self.config.evidence_reduction), reduced(valid, 2), intrinsics)

    def answers(
        self,
        image: Float[Tensor, "B C h w"],
        found: Evidence,
        valid: Float[Tensor, "B 1 h w"],
        intrinsics: Float[Tensor, "B 4"],
    ) -> list[Prediction]:
        """What follows from images at half the frames' size; this part is exported.

        Args:
            image: log counts of all slices, positive and negative in turn, then their mean times (`at_half_size`).
            found: local motion in them.
            valid: share of the pixel that the lens sees.
            intrinsics: of the full size, px.
        """
        slices = self.config.slices
        middle = slices // 2
        here = [image[:, 2 * middle : 2 * middle + 2], image[:, 2 * slices + middle : 2 * slices + middle + 1], valid]
        if self.config.coordinates:
            here.append(normalised_grid(resized_intrinsics(intrinsics, (2, 2), (1, 1)), valid))
        depth = self.depth_net(torch.cat(here, dim=1))
        depth, scales = self._geometry(depth, valid, intrinsics)
        answers = self.pose_net(torch.cat((image, valid), dim=1), found, scales)
        per_second = SLICES_PER_S
        return [
            Prediction(
                rel_depth=rel_depth,
                ego=answer.ego * per_second,
                residual=answer.residual * per_second,
                mixture=answer.mixture,
                seen=answer.flow / scale.focal_px * per_second,
                intrinsics=resized_intrinsics(intrinsics, (step, step), (1, 1)),  # padding made the ratio exact
                valid=scale.valid,
            )
            for rel_depth, answer, scale, step in zip(depth, answers, scales, self.config.steps, strict=True)
        ]

    def _geometry(
        self, log_depth: list[Tensor], valid: Tensor, intrinsics: Tensor
    ) -> tuple[list[Tensor], list[Geometry]]:
        """Relative depth and geometry of each scale, from coarse to fine."""
        focal_px = intrinsics[:, :2, None, None] / 2
        depths: list[Tensor] = []
        scales: list[Geometry] = []
        for step, scale in zip(self.config.steps, log_depth, strict=True):
            seen = reduced(valid, step // 2) if step > 2 else valid
            depth = mean_one(torch.exp(scale), seen)
            grid = normalised_grid(resized_intrinsics(intrinsics, (step, step), (1, 1)), scale)
            depths.append(depth)
            scales.append(Geometry(1 / depth, grid, focal_px, seen))
        return depths, scales
