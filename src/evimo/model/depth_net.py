"""The depth network: one slice in, relative depth out."""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from evimo.events.stack import BINS, FIT_FEATURES, SLICES
from evimo.model.backbone import EvenlyCascaded
from evimo.model.presets import ModelConfig

_CHANNELS = 2 * BINS
_FIRST = 2 * BINS * (SLICES // 2)
_FITS = 2 * FIT_FEATURES


class DepthNet(nn.Module):
    """log depth from the middle slice alone (paper, overview), refined from coarse to fine."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self.network = EvenlyCascaded(
            _CHANNELS,
            _FITS + 1 + 2,
            1,
            hidden=config.depth_hidden,
            growth=config.depth_growth,
            layers=config.first_layers,
        )

    def forward(
        self,
        voxels: Float[Tensor, "B 30 H W"],
        fits: Float[Tensor, "B 24 h w"],
        valid: Float[Tensor, "B 1 h w"],
        grid: Float[Tensor, "B 2 h w"],
    ) -> list[Tensor]:
        """log of the relative depth, (B, 1, h, w), from the coarsest to the finest scale (half the input's).

        Args:
            voxels, fits: of a stack; what other slices hold is not looked at.
            valid: share of the pixel that the lens sees.
            grid: coordinates of each pixel on the plane Z = 1.
        """
        middle = voxels[:, _FIRST : _FIRST + _CHANNELS]
        scales = self.network(middle, torch.cat((fits[:, :_FITS], valid, grid), dim=1))
        return [3 * torch.tanh(scale / 3) for scale in scales]  # depths within a factor of 20 of the mean
