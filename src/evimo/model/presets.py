"""Shapes of the two networks, by name."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class ModelConfig:
    """Shape of the two networks, as in the paper unless noted.

    The depth network has half the channels of the pose network (the authors' code has it the other way round): depth
    from one slice rests on priors, while the masks rest on motion.
    """

    hidden: int = 32  # channels of the pose network after its first layer
    growth: int = 32  # channels added per layer
    layers: int = 4  # encoding layers, and as many decoding
    scale: int = 2  # resolution step between layers
    objects: int = 3  # residual translations C; the paper gives no number, its recordings hold up to 3 objects
    slices: int = 5  # slices the pose network sees
    coordinates: bool = True  # the normalised coordinates of each pixel as two more channels

    @property
    def stride(self) -> int:
        """Both sides of the image are padded to a multiple of it, so that every scale is an exact fraction."""
        return 2 * self.scale**self.layers

    @property
    def steps(self) -> list[int]:
        """Image pixels per pixel of each scale that predicts, from coarse to fine."""
        return [2 * self.scale**k for k in reversed(range(self.layers))]

    @property
    def evidence_reduction(self) -> int:
        """How much coarser than half the image local motion is measured: the scale's first power from 3."""
        return self.scale if self.scale >= 3 else self.scale**2


PRESETS = {
    "base": ModelConfig(),
    "tiny": ModelConfig(hidden=8, growth=8, layers=2, scale=3),
}
