"""Evenly cascaded encoder and decoder (paper, evenly cascading network architecture): two feature streams.

The first `hidden` channels are the low-level stream, improved by residuals through the whole network; each encoding
layer grows `growth` high-level channels, each decoding layer merges them back into the low-level ones.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import avg_pool2d, conv2d, interpolate

_GAIN = 1.7  # keeps the variance of what a rectifier lets through
_RESIDUAL = 0.2  # share of what a residual adds at first


class Convolution(nn.Conv2d):
    """A convolution that keeps the resolution, with standardised weights (Brock et al., 2021).

    Takes the place of normalised features: in the exported graph it is a plain convolution.
    """

    def __init__(self, channels: int, out: int, *, size: int = 3, stride: int = 1) -> None:
        super().__init__(channels, out, size, stride, padding=size // 2)
        self.gain = nn.Parameter(torch.ones(out, 1, 1, 1))

    def standardised(self) -> Tensor:
        """The weights as they are used: mean 0 and squares that sum to 1 for each output channel, times its gain."""
        centred = self.weight - self.weight.mean((1, 2, 3), keepdim=True)
        return self.gain * centred / (centred.square().sum((1, 2, 3), keepdim=True) + 1e-4).sqrt()

    def forward(self, input: Tensor) -> Tensor:
        """Convolve."""
        return conv2d(input, self.standardised(), self.bias, self.stride, self.padding)


def reduced(image: Float[Tensor, "B C H W"], scale: int) -> Float[Tensor, "B C h w"]:
    """Area average over scale x scale pixels."""
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


def rectified(features: Tensor) -> Tensor:
    """What is above 0, at about the variance of all."""
    return _GAIN * torch.relu(features)


class Residual(nn.Module):
    """Two convolutions whose result improves the features, and adds `out - channels` new ones."""

    def __init__(self, channels: int, out: int) -> None:
        super().__init__()
        self.first, self.second = Convolution(channels, out), Convolution(out, out)
        self.share = nn.Parameter(torch.tensor(_RESIDUAL))

    def forward(self, features: Float[Tensor, "B C H W"]) -> Float[Tensor, "B D H W"]:
        """The improved features, then the new ones."""
        found = self.second(rectified(self.first(rectified(features))))
        channels = features.shape[1]
        improved = features + self.share * found[:, :channels]
        return improved if found.shape[1] == channels else torch.cat((improved, found[:, channels:]), dim=1)


class DecodingLayer(nn.Module):
    """Merge the high-level channels into the low-level ones, enlarge, let the skipped features modulate them."""

    def __init__(self, channels: int, out: int) -> None:
        super().__init__()
        self.merge, self.modulate = Convolution(channels, out, size=1), Residual(out, out)

    def forward(self, features: Float[Tensor, "B C h w"], skip: Float[Tensor, "B D H W"]) -> Float[Tensor, "B D H W"]:
        """Features of the next finer scale."""
        return self.modulate(enlarged(self.merge(features), 2) + skip)


class EvenlyCascaded(nn.Module):
    """Encoder and decoder with predictions at the coarsest scale, each refined by a residue on the way to the finest.

    The stem has a stride of 2, so that the finest prediction has half the input's size.
    """

    def __init__(self, channels: int, beside: int, out: int, *, hidden: int, growth: int, layers: int) -> None:
        """`beside`: channels of what joins the features after the stem; `out`: channels of the prediction."""
        super().__init__()
        self.precision = torch.float32  # of features; what comes out is float32 in any case
        widths = [hidden + k * growth for k in range(layers + 1)]
        self.stem, self.beside = Convolution(channels, hidden, stride=2), Convolution(beside, hidden, size=1)
        self.encoder = nn.ModuleList(Residual(widths[k], widths[k + 1]) for k in range(layers))
        self.bottom = Residual(widths[-1], widths[-1])
        self.decoder = nn.ModuleList(DecodingLayer(widths[k + 1], widths[k]) for k in reversed(range(layers)))
        self.heads = nn.ModuleList(nn.Conv2d(width, out, 3, padding=1) for width in reversed(widths))
        for head in self.heads:
            with torch.no_grad():
                head.weight *= 0.1  # type: ignore[operator]
                head.bias *= 0  # type: ignore[operator]

    def forward(self, image: Float[Tensor, "B C H W"], beside: Float[Tensor, "B D h w"]) -> list[Tensor]:
        """The predictions from the coarsest to the finest scale; `beside` has half the image's size."""
        lower = self.precision != torch.float32
        with torch.autocast(image.device.type, dtype=self.precision if lower else torch.bfloat16, enabled=lower):
            return [prediction.float() for prediction in self._predictions(image, beside)]

    def _predictions(self, image: Tensor, beside: Tensor) -> list[Tensor]:
        features = self.stem(image) + self.beside(beside)
        skips: list[Tensor] = []
        for layer in self.encoder:
            skips.append(features)
            features = layer(reduced(features, 2))
        features = self.bottom(features)
        predictions = [self.heads[0](rectified(features))]
        for layer, head, skip in zip(self.decoder, self.heads[1:], reversed(skips), strict=True):
            features = layer(features, skip)
            predictions.append(enlarged(predictions[-1], 2) + head(rectified(features)))
        return predictions
