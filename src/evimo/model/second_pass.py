"""The second pass of the pose network: what moves by itself, from events whose camera motion was taken out.

What stands still is sharp there, and what moves is not. It says the mixture, the flow that is left, a better depth, and
where to trust the flow; the egomotion is then fitted again without what moves, and the residual translations to what
that leaves (paper, eq. 2).
"""

from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor, nn

from evimo.events.stack import FITS, VOXELS
from evimo.geometry.grids import normalised_grid, resized_intrinsics
from evimo.model.backbone import EvenlyCascaded, enlarged, reduced, shares
from evimo.model.first_pass import FIRST_STEP, TwistPrior, mean_one
from evimo.model.fits import Geometry, residual_translations, robustly_fitted
from evimo.model.presets import ModelConfig

SECOND_STEP = 2  # px of the rectified image per pixel of the finest answer
_GUIDES = 2 + 2 + 1 + 1  # rigid flow, what the first pass saw beside it, log depth, valid


class Compensation(NamedTuple):
    """What was taken out of the events, and what the first pass saw; images at a quarter of the rectified image's size.

    ego:       (B, 6) of the middle slice, mean depths and rad per slice.
    rel_depth: (B, 1, h, w).
    rigid:     (B, 2, h, w) the flow of both, px per slice.
    seen:      (B, 2, h, w) the flow of everything, px per slice.
    """

    ego: Tensor
    rel_depth: Tensor
    rigid: Tensor
    seen: Tensor


def compensation(
    ego: Float[Tensor, "B 6"],
    rel_depth: Float[Tensor, "B 1 h w"],
    seen: Float[Tensor, "B 2 h w"],
    intrinsics: Float[Tensor, "B 4"],
) -> Compensation:
    """What was taken out by an egomotion at a depth (paper, eq. 1)."""
    grid = normalised_grid(resized_intrinsics(intrinsics, (FIRST_STEP, FIRST_STEP), (1, 1)), rel_depth)
    rigid = Geometry(1 / rel_depth, grid, intrinsics[:, :2, None, None]).rigid_flow(ego)
    return Compensation(ego, rel_depth, rigid, seen)


class SecondAnswer(NamedTuple):
    """What the second pass says at one scale.

    left:      (B, 2, h, w) flow besides the one taken out, px of the rectified image per slice.
    log_depth: (B, 1, h, w).
    logits:    (B, C+1, h, w) of the mixture.
    trust:     (B, 1, h, w) in the flow, 0...1.
    """

    left: Tensor
    log_depth: Tensor
    logits: Tensor
    trust: Tensor


class Motions(NamedTuple):
    """ego (B, 6) and residual (B, C, 3), mean depths and rad per slice."""

    ego: Tensor
    residual: Tensor


def bounded(flow: Tensor, knee: float) -> Tensor:
    """u / (1 + |u| / knee)."""
    return flow / (1 + flow.abs() / knee)


class SecondPass(nn.Module):
    """Compensated events in; mixture, flow, depth and all motions out."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self.channels = config.objects + 1
        self.network = EvenlyCascaded(
            VOXELS,
            FITS + _GUIDES,
            2 + 1 + self.channels + 1,
            hidden=config.hidden,
            growth=config.growth,
            layers=config.layers,
        )
        self.prior = TwistPrior()
        self.object_prior = nn.Parameter(torch.tensor(-4.0))  # log precision of the residual translations

    def forward(
        self,
        voxels: Float[Tensor, "B 30 H W"],
        fits: Float[Tensor, "B 24 h w"],
        valid: Float[Tensor, "B 1 h w"],
        taken: Compensation,
    ) -> list[SecondAnswer]:
        """From the coarsest to the finest scale, which has half the rectified image's size.

        Args:
            voxels: of the compensated events, at the rectified image's size.
            fits: of the same events, at half of it.
            valid: share of the pixel that the lens sees.
            taken: what was taken out.
        """
        log_depth = enlarged(taken.rel_depth.log(), 2)
        seen = bounded(taken.seen - taken.rigid, 4.0)
        guides = (enlarged(torch.cat((bounded(taken.rigid, 8.0) / 2, seen), dim=1), 2), log_depth, valid)
        answers: list[SecondAnswer] = []
        scales = self.network(voxels, torch.cat((fits, *guides), dim=1))
        for number, scale in enumerate(scales):
            left, deeper, logits, trust = scale.split((2, 1, self.channels, 1), dim=1)
            coarser = 2 ** (len(scales) - 1 - number)
            before = reduced(log_depth, coarser) if coarser > 1 else log_depth
            answers.append(SecondAnswer(SECOND_STEP * left, before + deeper, logits, torch.sigmoid(trust)))
        return answers

    def motions(
        self, answer: SecondAnswer, valid: Tensor, taken: Compensation, intrinsics: Tensor, rotation: Tensor
    ) -> Motions:
        """Egomotion and residual translations from the finest answer, fitted at a quarter of the image's size."""
        valid = reduced(valid, 2)
        depth = mean_one(reduced(answer.log_depth, 2).exp(), valid)
        step = 2 * SECOND_STEP
        grid = normalised_grid(resized_intrinsics(intrinsics, (step, step), (1, 1)), valid)
        geometry = Geometry(1 / depth, grid, intrinsics[:, :2, None, None])
        mixture = reduced(shares(answer.logits), 2)
        flow, trust = taken.rigid + reduced(answer.left, 2), reduced(answer.trust, 2) * valid
        ego = robustly_fitted(geometry, flow, trust * mixture[:, :1].detach(), self.prior(rotation), guess=taken.ego)
        error, prior = flow - geometry.rigid_flow(ego), self.object_prior.exp()
        return Motions(ego, residual_translations(geometry, error, mixture, weight=trust, prior=prior))
