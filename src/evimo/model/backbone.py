"""Evenly cascaded encoder and decoder (paper, evenly cascading network architecture): two feature streams.

The first `hidden` channels are the low-level stream, improved by residuals through the whole network; each encoding
layer grows `growth` high-level channels, each decoding layer convolves them back into the low-level ones.
"""

from math import gcd

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import avg_pool2d, interpolate


def normalised(channels: int) -> nn.GroupNorm:
    """Group normalisation with the largest divisor of the channels up to 16."""
    groups = max(divisor for divisor in range(1, 17) if gcd(divisor, channels) == divisor)
    return nn.GroupNorm(groups, channels)


def convolved(channels: int, out: int, *, size: int = 3) -> nn.Conv2d:
    """A convolution that keeps the resolution."""
    return nn.Conv2d(channels, out, size, padding=size // 2, bias=False)


def reduced(image: Float[Tensor, "B C H W"], scale: int) -> Float[Tensor, "B C h w"]:
    """Area average over scale x scale pixels; bilinear reduction by 3 would drop 8 of 9 pixels."""
    return avg_pool2d(image, scale)


def enlarged(image: Float[Tensor, "B C h w"], scale: int) -> Float[Tensor, "B C H W"]:
    """Bilinear, pixel areas aligned."""
    return interpolate(image, scale_factor=float(scale), mode="bilinear", align_corners=False)


def summed(image: Float[Tensor, "B C *size"]) -> Float[Tensor, "B 1 *size"]:
    """Sum over few channels; ONNX Runtime adds several times faster than it reduces."""
    return sum(image.split(1, dim=1)[1:], start=image[:, :1])


def shares(logits: Float[Tensor, "B C H W"]) -> Float[Tensor, "B C H W"]:
    """Softmax over the channels; bounded logits and a plain sum run several times faster in ONNX Runtime."""
    heights = logits.clamp(-20, 20).exp()
    return heights / summed(heights)


def before_convolution(channels: int, out: int) -> nn.Sequential:
    """Normalise, rectify, convolve."""
    return nn.Sequential(normalised(channels), nn.ReLU(), convolved(channels, out))


class EncodingLayer(nn.Module):
    """Grow new high-level channels, improve the old ones by a residual, reduce all."""

    def __init__(self, channels: int, growth: int, scale: int) -> None:
        super().__init__()
        self.scale = scale
        self.body = nn.Sequential(
            before_convolution(channels, channels + growth), before_convolution(channels + growth, channels + growth)
        )

    def forward(self, features: Float[Tensor, "B C H W"]) -> Float[Tensor, "B D h w"]:
        """Features of the next coarser scale."""
        grown = self.body(features)
        channels = features.shape[1]
        both = torch.cat((grown[:, :channels] + features, grown[:, channels:]), dim=1)
        return reduced(both, self.scale)


class DecodingLayer(nn.Module):
    """Enlarge, merge the high-level channels into the low-level ones, let the skipped features modulate them."""

    def __init__(self, channels: int, out: int, skipped: int, scale: int) -> None:
        super().__init__()
        self.scale, self.out = scale, out
        self.merge = before_convolution(channels, out)
        self.modulate = before_convolution(out + skipped, out)

    def forward(self, features: Float[Tensor, "B C h w"], skip: Float[Tensor, "B S H W"]) -> Float[Tensor, "B D H W"]:
        """Features of the next finer scale."""
        features = enlarged(features, self.scale)
        features = self.merge(features) + features[:, : self.out]
        return self.modulate(torch.cat((features, skip), dim=1)) + features


class Encoder(nn.Module):
    """A stem and `layers` encoding layers; returns the features of every scale, the input's own first.

    The input has half the image's size: pooled by area average, not by the paper's strided stem, which at full size
    costs more than all the rest.
    """

    def __init__(self, channels: int, *, hidden: int, growth: int, layers: int, scale: int) -> None:
        super().__init__()
        self.stem = convolved(channels, hidden)
        self.layers = nn.ModuleList(EncodingLayer(hidden + k * growth, growth, scale) for k in range(layers))

    def forward(self, image: Float[Tensor, "B C H W"], beside: Tensor | None = None) -> list[Tensor]:
        """Features from fine to coarse; `beside` is added to what comes out of the stem."""
        features = self.stem(image)
        scales = [features if beside is None else features + beside]
        for layer in self.layers:
            scales.append(layer(scales[-1]))
        return scales


def decoding_layers(*, hidden: int, growth: int, layers: int, scale: int) -> nn.ModuleList:
    """One decoding layer per encoding layer, from coarse to fine; the finest scale is half the image."""
    widths = [hidden + k * growth for k in range(layers + 1)]
    return nn.ModuleList(DecodingLayer(widths[k + 1], widths[k], widths[k], scale) for k in reversed(range(layers)))
