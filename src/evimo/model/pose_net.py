"""The pose network: five slices in; per scale the flow it sees, the egomotion behind it, and the mixture.

Encoder and decoder are the paper's. Where the paper regresses poses from pooled features, here each decoding layer
blends local motion candidates (`evidence`) into a flow, fits the egomotion to it (`fits`), and shows the mixture head
what does not fit.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor, nn

from evimo.geometry.motion_field import motion_field
from evimo.model.backbone import (
    Encoder,
    before_convolution,
    convolved,
    decoding_layers,
    enlarged,
    reduced,
    shares,
    summed,
)
from evimo.model.evidence import CANDIDATES, TRUSTS, Evidence
from evimo.model.fits import fitted, flow_per_twist, mismatch
from evimo.model.presets import ModelConfig

_TRUSTED = [0, 1, 5, 8]  # of the evidence's trust: contrast, spread, what still changes after either warp
_CUES = 7 + 1 + len(_TRUSTED)  # channels a mixture head sees beside features and logits


class Scale(NamedTuple):
    """What the pose network says at one scale.

    flow:       (B, 2, h, w) the flow seen, in px of half the image per slice.
    ego:        (B, 6) the twist that explains it, per slice.
    residual:   (B, C, 3) translations of the mixture, per slice.
    mixture:    (B, C+1, h, w) sums to 1; channel 0 is the background.
    """

    flow: Tensor
    ego: Tensor
    residual: Tensor
    mixture: Tensor


@dataclass(frozen=True)
class Geometry:
    """What a scale must know of depth and lens.

    inv_depth: (B, 1, h, w) relative.
    grid:      (B, 2, h, w) on the plane Z = 1.
    focal_px:  (B, 2, 1, 1) of half the image: its px per unit of the plane.
    valid:     (B, 1, h, w) share of the pixel that the lens sees.
    """

    inv_depth: Tensor
    grid: Tensor
    focal_px: Tensor
    valid: Tensor

    @cached_property
    def basis(self) -> Tensor:
        """(B, 6, 2, h, w) flow on the plane Z = 1 for a unit of each component of the twist."""
        return flow_per_twist(self.inv_depth, self.grid)


class Coarser(NamedTuple):
    """What a coarser scale said: flow and mixture logits, enlarged to the scale at hand, and egomotion."""

    flow: Tensor
    logits: Tensor
    ego: Tensor


class Fitting(NamedTuple):
    """Where twists are fitted: a grid no finer than that of the evidence, for its speed.

    finer:    how many times finer the scale's own grid is.
    across:   (B, 3, h, w) trust by direction.
    geometry: of that grid.
    """

    finer: int
    across: Tensor
    geometry: Geometry

    def down(self, image: Tensor) -> Tensor:
        """From the scale's grid to this one."""
        return reduced(image, self.finer) if self.finer > 1 else image


def soft(values: Tensor, knee: float = 3.0) -> Tensor:
    """u / (1 + |u| / knee): linear for slow, bounded for fast motion."""
    return values / (1 + values.abs() / knee)


def rigid_flow(ego: Tensor, geometry: Geometry) -> Float[Tensor, "B 2 H W"]:
    """Flow of the static world, px of half the image per slice."""
    return motion_field(ego[..., None, None], geometry.inv_depth, geometry.grid) * geometry.focal_px


def explained(
    flow: Float[Tensor, "B 2 H W"],
    weight: Float[Tensor, "B 3 H W"],
    geometry: Geometry,
    prior: Tensor,
    guess: Tensor | None,
) -> tuple[Tensor, Tensor]:
    """Egomotion that explains most of the flow.

    Args:
        flow: px of half the image per slice.
        weight: trust by direction.
        geometry: of the flow's grid.
        prior: of the twist, see `fitted`.
        guess: a good egomotion to start from; without one, plain least squares.

    Returns:
        ego (B, 6) per slice, and the mean square (B, 1, 1, 1), px, of what the guess before it left.
    """
    on_plane = flow / geometry.focal_px
    rounds = 1 if guess is not None else 2
    ego = fitted(geometry.basis, on_plane, weight[:, None], prior)[:, 0] if guess is None else guess
    trusted = weight
    square = flow[:, :1, :1, :1]
    for _ in range(rounds):  # Cauchy's weights: what moves by itself loses its say
        error = flow - rigid_flow(ego, geometry)
        total = (trusted[:, :1] + trusted[:, 2:]).sum((1, 2, 3), keepdim=True) + 1e-3
        square = mismatch(error, trusted).sum((1, 2, 3), keepdim=True) / total + 0.0025
        per_trust = mismatch(error, weight) / (weight[:, :1] + weight[:, 2:] + 1e-6)
        trusted = weight / (1 + 0.5 * per_trust / square)
        ego = fitted(geometry.basis, on_plane, trusted[:, None], prior)[:, 0]
    return ego, square


def cues(flow: Tensor, error: Tensor, square: Tensor) -> Float[Tensor, "B 7 H W"]:
    """What a mask can be read from: motion that the camera's does not explain, in px and against its scatter."""
    size = (summed(error.square()) + 1e-6).sqrt()
    return torch.cat((soft(error, 2.0), soft(size, 2.0), soft(error / square.sqrt()), soft(flow)), dim=1)


class PoseScale(nn.Module):
    """One scale: flow, egomotion, mixture; each refines what the coarser scale said."""

    def __init__(self, channels: int, config: ModelConfig) -> None:
        super().__init__()
        width = config.hidden + config.growth
        self.channels = config.objects + 1
        self.flow_head = before_convolution(channels, CANDIDATES + 1 + 2 + 1)
        self.mask_features = nn.Conv2d(channels + _CUES + config.objects + 1, width, 3, padding=1)
        self.mask_head = nn.Conv2d(width, config.objects + 1, 3, padding=1)
        # What keeps translation and rotation apart where the flow cannot: log(1 / variance) of each, per slice.
        self.prior = nn.Parameter(torch.tensor([-3.5, -5.8]))

    def seen(self, features: Tensor, motion: Tensor, before: Tensor) -> tuple[Tensor, Tensor]:
        """Blend the candidates and the coarser flow, add a residue; the flow and the confidence in it."""
        blend, residue, confidence = self.flow_head(features).split((CANDIDATES + 1, 2, 1), dim=1)
        candidates = torch.cat((motion, before[:, None]), dim=1)
        speed = soft(motion[:, 1], 8.0).square().mean((1, 2, 3), keepdim=True).sqrt()  # normalised features know none
        flow = summed(shares(blend)[:, :, None] * candidates)[:, 0] + residue * (speed + 0.1)
        return flow, torch.sigmoid(confidence)

    def forward(
        self, features: Tensor, found: Evidence, fitting: Fitting, geometry: Geometry, before: Coarser | None
    ) -> tuple[Scale, Tensor]:
        """The scale's answer and its mixture logits; `before` is what the coarser scale said, enlarged."""
        flow, confidence = self.seen(features, found.motion, found.motion[:, 1] if before is None else before.flow)
        sure = fitting.across * fitting.down(confidence * geometry.valid)
        still = sure if before is None else sure * fitting.down(shares(before.logits)[:, :1].detach())
        prior = self.prior.exp().repeat_interleave(3)
        guess = None if before is None else before.ego
        ego, square = explained(fitting.down(flow), still, fitting.geometry, prior, guess)
        error = flow - rigid_flow(ego, geometry)
        logits = features[:, : self.channels] * 0 if before is None else before.logits
        seen = (features, cues(flow, error, square), confidence, found.trust, logits)
        logits = logits + self.mask_head(torch.relu(self.mask_features(torch.cat(seen, dim=1))))
        mixture = shares(logits)
        # Squared: a hundredth of a share on all of the background would outweigh an object of a hundredth of the image.
        theirs = fitting.down(mixture[:, 1:]).square()[:, :, None] * sure[:, None]
        residual = fitted(fitting.geometry.basis[:, :3], fitting.down(error) / geometry.focal_px, theirs, prior[:3])
        return Scale(flow, ego, residual, mixture), logits


class PoseNet(nn.Module):
    """Encoder and decoder over all slices; every decoding layer ends in a `PoseScale`."""

    def __init__(self, config: ModelConfig, channels: int) -> None:
        super().__init__()
        hidden, growth, layers, scale = config.hidden, config.growth, config.layers, config.scale
        self.scale, self.reduction = scale, config.evidence_reduction
        self.encoder = Encoder(channels, hidden=hidden, growth=growth, layers=layers, scale=scale)
        self.beside = convolved(2 * CANDIDATES + TRUSTS + 2 * config.coordinates, hidden, size=1)
        self.coordinates = config.coordinates
        self.decoder = decoding_layers(hidden=hidden, growth=growth, layers=layers, scale=scale)
        self.scales = nn.ModuleList(PoseScale(hidden + k * growth, config) for k in reversed(range(layers)))

    def forward(self, image: Tensor, found: Evidence, geometry: list[Geometry]) -> list[Scale]:
        """From the coarsest to the finest scale.

        Args:
            image: (B, C, h, w) all input channels, at half the image's size.
            found: local motion in it.
            geometry: of each scale, in the same order.
        """
        steps = [self.scale**k for k in reversed(range(len(self.scales)))]  # of each scale, against half the image
        at_evidence = geometry[steps.index(self.reduction)]
        local = [soft(found.motion).flatten(1, 2), found.trust, *([at_evidence.grid] if self.coordinates else [])]
        beside = self.beside(torch.cat(local, dim=1))
        *skips, features = self.encoder(image, enlarged(beside, self.reduction))
        found = found._replace(trust=found.trust[:, _TRUSTED])
        before, answers = None, []
        for layer, head, skip, step, here in zip(
            self.decoder, self.scales, reversed(skips), steps, geometry, strict=True
        ):
            features = layer(features, skip)
            local = _resized(found, self.reduction, step)
            finer = max(1, self.reduction // step)
            fitting = Fitting(finer, found.across, at_evidence) if finer > 1 else Fitting(1, local.across, here)
            answer, logits = head(features, local, fitting, here, before)
            answers.append(answer)
            before = Coarser(enlarged(answer.flow, self.scale), enlarged(logits, self.scale), answer.ego)
        return answers


def _resized(found: Evidence, reduction: int, step: int) -> Evidence:
    """The evidence on the grid of a scale; motion stays in px of half the image."""
    if step == reduction:
        return found

    def resize(image: Tensor) -> Tensor:
        return reduced(image, step // reduction) if step > reduction else enlarged(image, reduction // step)

    return Evidence(
        resize(found.motion.flatten(1, 2)).unflatten(1, (CANDIDATES, 2)), resize(found.trust), resize(found.across)
    )
