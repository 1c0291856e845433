"""Depth network and pose network joined by the geometry of the paper."""

from typing import NamedTuple

from jaxtyping import Float
from torch import Tensor, nn

from evimo.geometry.grids import normalised_grid, resized_intrinsics
from evimo.geometry.motion_field import motion_field, pixel_residual, pixel_twist
from evimo.model.backbone import enlarged, reduced, shares
from evimo.model.first_pass import FirstAnswer, FirstPass, mean_one
from evimo.model.presets import ModelConfig
from evimo.model.second_pass import SECOND_STEP, Compensation, Motions, SecondAnswer, SecondPass

SLICES_PER_S = 40.0  # a slice lasts 25 ms


class Prediction(NamedTuple):
    """The model's answer at one scale, valid at the centre of the middle slice.

    rel_depth:  (B, 1, h, w) mean 1 over the valid pixels.
    ego:        (B, 6) mean depths per second and rad/s.
    residual:   (B, C, 3) mean depths per second.
    mixture:    (B, C+1, h, w).
    seen:       (B, 2, h, w) the flow the pose network sees, 1/s on the plane Z = 1; egomotion is fitted to it.
    taken:      (B, 2, h, w) the flow that was taken out of the events, in the same unit.
    confidence: (B, 1, h, w) how much each pixel's flow counts in the fits of the motions, 0...1.
    intrinsics: (B, 4) fx fy cx cy of this scale, px.
    valid:      (B, 1, h, w) share of the pixel that the lens sees.
    """

    rel_depth: Tensor
    ego: Tensor
    residual: Tensor
    mixture: Tensor
    seen: Tensor
    taken: Tensor
    confidence: Tensor
    intrinsics: Tensor
    valid: Tensor

    @property
    def flow(self) -> Tensor:
        """(B, 2, h, w) by equations 1 and 2, in 1/s on the plane Z = 1."""
        grid = normalised_grid(self.intrinsics, self.rel_depth)
        return motion_field(pixel_twist(self.ego, self.residual, self.mixture), 1 / self.rel_depth, grid)

    @property
    def object_velocity(self) -> Tensor:
        """(B, 3, h, w) of what each pixel shows: minus the sum of equation 2, so that it is the velocity in `flow`."""
        return -pixel_residual(self.residual, self.mixture)


class MotionNet(nn.Module):
    """The depth network and both passes of the pose network; between the passes events are compensated outside."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self.config = config
        self.first_pass = FirstPass(config)
        self.second_pass = SecondPass(config)

    def first(
        self,
        voxels: Float[Tensor, "B 30 h w"],
        fits: Float[Tensor, "B 24 h w"],
        candidates: Float[Tensor, "B 22 c d"],
        valid: Float[Tensor, "B 1 h w"],
        intrinsics: Float[Tensor, "B 4"],
        rotation: Float[Tensor, "B 4"],
    ) -> FirstAnswer:
        """The camera's motion from the events as they come, see `FirstPass.forward`."""
        return self.first_pass(voxels, fits, candidates, valid, intrinsics, rotation)

    def second(
        self,
        voxels: Float[Tensor, "B 30 H W"],
        fits: Float[Tensor, "B 24 h w"],
        valid: Float[Tensor, "B 1 h w"],
        taken: Compensation,
        intrinsics: Float[Tensor, "B 4"],
        rotation: Float[Tensor, "B 4"],
    ) -> list[Prediction]:
        """The answer from compensated events, from the coarsest to the finest scale, see `SecondPass`.

        Args:
            voxels, fits: of the compensated events.
            valid: share of the pixel that the lens sees.
            taken: the egomotion and depth that were taken out of them, and what the first pass saw.
            intrinsics: of the rectified image, px.
            rotation: of a gyroscope, rad per slice, and 1; or zeros.
        """
        answers = self.second_pass(voxels, fits, valid, taken)
        motions = self.second_pass.motions(answers[-1], valid, taken, intrinsics, rotation)
        steps = [2**k for k in reversed(range(len(answers)))]
        return [
            self._prediction(answer, motions, valid, taken, intrinsics, step)
            for answer, step in zip(answers, steps, strict=True)
        ]

    def _prediction(
        self,
        answer: SecondAnswer,
        motions: Motions,
        valid: Tensor,
        taken: Compensation,
        intrinsics: Tensor,
        step: int,
    ) -> Prediction:
        """One scale, `step` times coarser than the finest."""
        valid = reduced(valid, step) if step > 1 else valid
        rigid = enlarged(taken.rigid, 2) if step == 1 else taken.rigid if step == 2 else reduced(taken.rigid, step // 2)
        image_px, focal_px = SECOND_STEP * step, intrinsics[:, :2, None, None]
        return Prediction(
            rel_depth=mean_one(answer.log_depth.exp(), valid),
            ego=motions.ego * SLICES_PER_S,
            residual=motions.residual * SLICES_PER_S,
            mixture=shares(answer.logits),
            seen=(rigid + answer.left) / focal_px * SLICES_PER_S,
            taken=rigid / focal_px * SLICES_PER_S,
            confidence=answer.trust,
            intrinsics=resized_intrinsics(intrinsics, (image_px, image_px), (1, 1)),  # padding made the ratio exact
            valid=valid,
        )
