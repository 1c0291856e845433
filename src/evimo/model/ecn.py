"""The evenly cascaded network (ECN) of Ye, Mitrokhin and others, 2018: depth and one motion of the camera, no masks.

The paper's rival, which learns from warping alone. It looks once, at the events as they come, at half the size: what
comes out of it is what the first pass of the other networks says.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from evimo.events.stack import BINS, SLICES, VOXELS
from evimo.geometry.grids import normalised_grid, resized_intrinsics
from evimo.model.backbone import EvenlyCascaded, enlarged, reduced, summed
from evimo.model.first_pass import FIRST_STEP, FirstAnswer, mean_one
from evimo.model.fits import Geometry
from evimo.model.presets import EcnConfig

_SLICE = 2 * BINS  # channels of one slice
_BESIDE = 1 + 2  # valid, grid
_REACH_PX = 4.0  # image motion per slice that a vote of 1 is for


class Ecn(nn.Module):
    """Depth from the middle slice alone, the camera's motion from all five: two networks, the second half as wide."""

    def __init__(self, config: EcnConfig) -> None:
        super().__init__()
        self.config = config
        shape = {"growth": config.growth, "layers": config.layers}
        self.depth_net = EvenlyCascaded(_SLICE, _BESIDE, 1, hidden=config.hidden, **shape)
        shape = {"growth": config.growth // 2, "layers": config.layers}
        self.pose_net = EvenlyCascaded(VOXELS, _BESIDE, 6 + 1, hidden=config.hidden // 2, **shape)

    def forward(
        self,
        voxels: Float[Tensor, "B 30 H W"],
        valid: Float[Tensor, "B 1 H W"],
        intrinsics: Float[Tensor, "B 4"],
    ) -> tuple[list[FirstAnswer], Float[Tensor, "B 1 h w"]]:
        """The answers from the coarsest to the finest scale, which has half the size of these images.

        Args:
            voxels: of the events as they come, at half the rectified image's size.
            valid: share of the pixel that the lens sees, at the same size.
            intrinsics: of the rectified image, px.

        Returns:
            the answers, and how much each pixel of the finest scale counts in the camera's motion.
        """
        half = resized_intrinsics(intrinsics, (FIRST_STEP // 2, FIRST_STEP // 2), (1, 1))
        beside = reduced(torch.cat((valid, normalised_grid(half, valid)), dim=1), 2)
        first = _SLICE * (SLICES // 2)
        log_depths = self.depth_net(voxels[:, first : first + _SLICE], beside)
        votes, trust = self.pose_net(voxels, beside)[-1].split((6, 1), dim=1)
        trust = torch.sigmoid(trust) * beside[:, :1]
        ego = self._ego(votes, trust, intrinsics)
        steps = [FIRST_STEP * 2**k for k in reversed(range(len(log_depths)))]
        answers = [
            _answer(log_depth, ego, valid, intrinsics, step) for log_depth, step in zip(log_depths, steps, strict=True)
        ]
        return answers, trust

    def finest(
        self,
        voxels: Float[Tensor, "B 30 H W"],
        valid: Float[Tensor, "B 1 H W"],
        intrinsics: Float[Tensor, "B 4"],
    ) -> tuple[FirstAnswer, Float[Tensor, "B 1 H W"]]:
        """The finest answer, and how much each pixel counts in it, enlarged to the size of what the network sees."""
        answers, trust = self(voxels, valid, intrinsics)
        said = answers[-1]
        whole = FirstAnswer(enlarged(said.rel_depth, 2), said.ego, enlarged(said.flow, 2), valid)
        return whole, enlarged(trust, 2)

    def _ego(self, votes: Tensor, trust: Tensor, intrinsics: Tensor) -> Float[Tensor, "B 6"]:
        """Mean depths and rad per slice: the mean of all pixels' votes, which are image motions at the mean depth."""
        vote = (votes * trust).sum((2, 3)) / (trust.sum((2, 3)) + 1e-3)
        return _REACH_PX * vote / summed(intrinsics[:, :2]) * 2


def _answer(log_depth: Tensor, ego: Tensor, valid: Tensor, intrinsics: Tensor, step: int) -> FirstAnswer:
    """What is said at one scale, of `step` px of the rectified image per pixel."""
    here = reduced(valid, step * 2 // FIRST_STEP)
    total = (log_depth * here).sum((1, 2, 3), keepdim=True)
    # Warping does not ask for the mean: left free, it drifts until the bound has flattened all depths.
    relief = log_depth - total / (here.sum((1, 2, 3), keepdim=True) + 1e-6)
    depth = mean_one(torch.exp(3 * torch.tanh(relief / 3)), here)  # within a factor of 20 of the mean, as ours
    grid = normalised_grid(resized_intrinsics(intrinsics, (step, step), (1, 1)), depth)
    flow = Geometry(1 / depth, grid, intrinsics[:, :2, None, None]).rigid_flow(ego)
    return FirstAnswer(depth, ego, flow, here)
