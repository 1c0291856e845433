"""Pools: what the scenes of one part of a data set may be drawn from, so that no other part sees any of it."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from evimo.scene.bodies import BOX, CYLINDER, ELLIPSOID
from evimo.scene.textures.bank import TextureBank, texture_bank

Family = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class Pool:
    """Textures and families of shapes of one part of a data set; two pools share none of either.

    number: of the pool, from 1; its texture banks differ from every bank drawn without a pool.
    parity: 0 or 1: its compounds have an even or an odd number of round primitives; both are half of all.
    """

    number: int
    parity: int

    def bank(self, seed: int, images: Path | None = None, *, maps: int = 0) -> TextureBank:
        """Textures that no other pool has; `images` and `maps` as in `texture_bank`."""
        return texture_bank(seed, pool=self.number, images=images, maps=maps)

    def holds(self, shapes: Iterable[int]) -> bool:
        """Whether compounds of these primitives belong to it."""
        _, ellipsoids, cylinders = family(shapes)
        return (ellipsoids + cylinders) % 2 == self.parity


POOLS = {"train": Pool(1, 0), "test": Pool(2, 1)}


def family(shapes: Iterable[int]) -> Family:
    """How many boxes, ellipsoids and cylinders make up a compound."""
    found = list(shapes)
    return found.count(BOX), found.count(ELLIPSOID), found.count(CYLINDER)
