"""Shapes of the networks, by name."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class ModelConfig:
    """Shape of the networks.

    The pose network looks twice (docs/decisions/0006-compensate-first.md): `hidden`, `growth` and `layers` are those of
    its second pass; the first pass and the depth network, at half the size, are smaller.
    """

    hidden: int = 32  # channels of the second pass after its first layer
    growth: int = 32  # channels added per layer
    layers: int = 4  # encoding layers, and as many decoding
    first_hidden: int = 16  # of the first pass
    first_growth: int = 16
    depth_hidden: int = 12  # of the depth network
    depth_growth: int = 12
    first_layers: int = 3  # of the first pass and the depth network
    objects: int = 3  # residual translations C; the paper gives no number, its recordings hold up to 3 objects

    @property
    def stride(self) -> int:
        """Both sides of the image are padded to a multiple of it, so that every scale is an exact fraction."""
        return max(2 * 2**self.layers, 4 * 2**self.first_layers)


@dataclass(frozen=True, kw_only=True)
class EcnConfig:
    """Shape of the paper's rival (`ecn.Ecn`), whose name for it is ECN; it has no passes, and no objects."""

    hidden: int = 12  # channels of the depth network after its first layer; the pose network has half of all
    growth: int = 10
    layers: int = 3

    @property
    def stride(self) -> int:
        """As of `ModelConfig`."""
        return 4 * 2**self.layers


Config = ModelConfig | EcnConfig

ECN = "ecn"
PRESETS: dict[str, Config] = {
    "base": ModelConfig(hidden=32, growth=32, first_hidden=20, first_growth=20),
    "small": ModelConfig(hidden=16, growth=20, first_hidden=12, first_growth=12, depth_hidden=8, depth_growth=8),
    "tiny": ModelConfig(hidden=6, growth=3, layers=3, first_hidden=4, first_growth=2, depth_hidden=4, depth_growth=2),
    ECN: EcnConfig(),
}
