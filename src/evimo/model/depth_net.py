"""The depth network: one slice in, relative depth at every scale out."""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from evimo.model.backbone import Encoder, before_convolution, decoding_layers, enlarged
from evimo.model.presets import ModelConfig


class DepthNet(nn.Module):
    """log depth, refined from coarse to fine: each scale adds to the enlarged prediction of the one before."""

    def __init__(self, config: ModelConfig, channels: int) -> None:
        super().__init__()
        hidden, growth, layers, scale = config.hidden // 2, config.growth // 2, config.layers, config.scale
        self.scale = scale
        self.encoder = Encoder(channels, hidden=hidden, growth=growth, layers=layers, scale=scale)
        self.decoder = decoding_layers(hidden=hidden, growth=growth, layers=layers, scale=scale)
        self.heads = nn.ModuleList(before_convolution(hidden + k * growth, 1) for k in reversed(range(layers)))

    def forward(self, image: Float[Tensor, "B C H W"]) -> list[Tensor]:
        """log of the relative depth, (B, 1, h, w), from the coarsest to the finest scale (half the image)."""
        *skips, features = self.encoder(image)
        prediction, scales = None, []
        for layer, head, skip in zip(self.decoder, self.heads, reversed(skips), strict=True):
            if prediction is not None:
                prediction = enlarged(prediction, self.scale)
            features = layer(features, skip)
            if prediction is not None:  # the paper merges the running prediction into the features
                features = torch.cat((features[:, :1] + prediction, features[:, 1:]), dim=1)
            residue = head(features)
            prediction = residue if prediction is None else prediction + residue
            scales.append(prediction)
        return [3 * torch.tanh(scale / 3) for scale in scales]  # depths within a factor of 20 of the mean
