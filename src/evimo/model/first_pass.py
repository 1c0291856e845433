"""The first pass of the pose network: the camera's motion, from the events as they come.

It sees a flow, and the twist that explains most of it at the depth network's depth is the egomotion. What it finds is
taken out of the events (`events.stack.compensated`) before the second pass looks.
"""

from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor, nn

from evimo.events.local_motion import CANDIDATE_CHANNELS, CANDIDATES
from evimo.events.stack import FITS, VOXELS
from evimo.geometry.grids import normalised_grid, resized_intrinsics
from evimo.model.backbone import EvenlyCascaded, reduced, shares
from evimo.model.depth_net import DepthNet
from evimo.model.fits import Geometry, Prior, robustly_fitted
from evimo.model.presets import ModelConfig

KNOWN_ROTATION = 1e3  # precision of a rotation that a gyroscope measured
_HALF = 2  # px of the rectified image per px of the candidates
FIRST_STEP = 4  # px of the rectified image per pixel of the first pass's answer


class FirstAnswer(NamedTuple):
    """What the first pass says, at a quarter of the rectified image's size (h, w).

    rel_depth: (B, 1, h, w) mean 1 over the valid pixels.
    ego:       (B, 6) mean depths and rad per slice.
    flow:      (B, 2, h, w) the flow it sees, px of the rectified image per slice; of all that is there, movers too.
    valid:     (B, 1, h, w) share of the pixel that the lens sees.
    """

    rel_depth: Tensor
    ego: Tensor
    flow: Tensor
    valid: Tensor


def mean_one(depth: Tensor, valid: Tensor) -> Tensor:
    """Depth divided by its mean over the valid pixels."""
    total = (depth * valid).sum((1, 2, 3), keepdim=True)
    return depth * (valid.sum((1, 2, 3), keepdim=True) + 1e-6) / (total + 1e-6)


class TwistPrior(nn.Module):
    """What is known of a twist: it is small, and a gyroscope may have measured its rotation.

    Keeps translation and rotation apart where the flow cannot.
    """

    def __init__(self) -> None:
        super().__init__()
        self.log_precision = nn.Parameter(torch.tensor([-4.0, -6.0]))  # of translation and of rotation

    def forward(self, rotation: Float[Tensor, "B 4"]) -> Prior:
        """The prior.

        Args:
            rotation: of a gyroscope, rad per slice, and 1, or zeros.
        """
        measured, known = rotation.split((3, 1), dim=1)
        translation, turning = self.log_precision.exp().split(1)
        precision = torch.cat((translation + 0 * measured, turning + KNOWN_ROTATION * known + 0 * measured), dim=1)
        return Prior(torch.cat((0 * measured, measured * known), dim=1), precision)


class FirstPass(nn.Module):
    """Depth from the middle slice, flow from the whole stack, egomotion from both."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self.depth_net = DepthNet(config)
        self.flow_net = EvenlyCascaded(
            VOXELS,
            FITS + CANDIDATE_CHANNELS + 1,
            2 + 1 + CANDIDATES + 1,
            hidden=config.first_hidden,
            growth=config.first_growth,
            layers=config.first_layers,
        )
        self.prior = TwistPrior()

    def forward(
        self,
        voxels: Float[Tensor, "B 30 H W"],
        fits: Float[Tensor, "B 24 H W"],
        candidates: Float[Tensor, "B 22 h w"],
        valid: Float[Tensor, "B 1 H W"],
        intrinsics: Float[Tensor, "B 4"],
        rotation: Float[Tensor, "B 4"],
    ) -> FirstAnswer:
        """All images but the candidates have half the rectified image's size.

        Args:
            voxels, fits: of the events as they come.
            candidates: of local motion (`events.local_motion`), at a quarter of the size.
            valid: share of the pixel that the lens sees.
            intrinsics: of the rectified image, px.
            rotation: of a gyroscope, rad per slice, and 1; or zeros.
        """
        fits, valid = reduced(fits, 2), reduced(valid, 2)
        grid = normalised_grid(resized_intrinsics(intrinsics, (FIRST_STEP, FIRST_STEP), (1, 1)), valid)
        depth = mean_one(torch.exp(self.depth_net(voxels, fits, valid, grid)[-1]), valid)
        flow, confidence = self._seen(voxels, fits, candidates, valid)
        geometry = Geometry(1 / depth, grid, intrinsics[:, :2, None, None])
        ego = robustly_fitted(geometry, flow, torch.sigmoid(confidence) * valid, self.prior(rotation))
        return FirstAnswer(depth, ego, flow, valid)

    def _seen(self, voxels: Tensor, fits: Tensor, candidates: Tensor, valid: Tensor) -> tuple[Tensor, Tensor]:
        """Flow, px per slice: the candidates and no motion, blended pixel by pixel, and a residue; and its logit."""
        motion, trusts = candidates.split((2 * CANDIDATES, CANDIDATE_CHANNELS - 2 * CANDIDATES), dim=1)
        beside = torch.cat((fits, motion / (1 + motion.abs() / 3), trusts, valid), dim=1)
        residue, confidence, blend = self.flow_net(voxels, beside)[-1].split((2, 1, CANDIDATES + 1), dim=1)
        share = shares(blend)[:, :CANDIDATES, None]
        blended = (share * motion.unflatten(1, (CANDIDATES, 2))).sum(1)
        return _HALF * blended + FIRST_STEP * residue, confidence
