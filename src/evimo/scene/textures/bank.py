"""The bank of textures of a scene: patterns with all their mip levels, plain ones and dense ones."""

from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evimo.scene.textures.natural import installed, own_photos
from evimo.scene.textures.patterns import texture

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
PLAIN_MIX = ("plain", "gradient", "plain", "plain")
DENSE_MIX = (
    "natural", "shapes", "natural", "labelled", "natural", "lines", "natural", "text", "labelled",
    "natural", "checker", "natural", "shapes", "natural", "labelled", "stripes", "natural", "voronoi",
    "natural", "collage", "natural", "labelled", "lines", "carpet", "shapes", "fractal", "speckle",
)  # fmt: skip
"""What a bank holds, in turns: few strong edges on plain ground, as real rooms have, rather than weak fine noise."""
ONLY_IN = {"checker": 1, "stripes": 2}  # pools; with so few different patterns, two would draw the same


class TextureBank(NamedTuple):
    """Every mip level of every texture, flat.

    texels: float32; level l holds (N, SIZE >> l, SIZE >> l) from offsets[l] on.
    plain, dense: indices of textures without and with visible pattern. maps: of streets, if it has any.
    """

    texels: F4
    offsets: NDArray[np.int64]
    plain: NDArray[np.int64]
    dense: NDArray[np.int64]
    maps: NDArray[np.int64] = np.arange(0)


@lru_cache(maxsize=2)
def texture_bank(
    seed: int, *, plain: int = 14, dense: int = 86, maps: int = 0, pool: int = 0, images: Path | None = None
) -> TextureBank:
    """The bank of one seed and pool; kinds take turns, so that every bank has every kind its pool may have.

    images: a folder of the user's own pictures, from which half of the natural textures are cut then; of two pools
    each has every other picture of it. maps: textures of streets that it has besides; the others stay what they are.

    Raises:
        NotFound, BadFile: as `textures_of` says.
    """
    rng = np.random.default_rng((seed, 0xBA4C, pool) if pool else (seed, 0xBA4C))
    photos = installed(pool), own_photos(images, pool) if images else ()
    patterned = [kind for kind in DENSE_MIX if not pool or ONLY_IN.get(kind, pool) == pool]
    kinds = (
        [PLAIN_MIX[i % len(PLAIN_MIX)] for i in range(plain)]
        + [patterned[i % len(patterned)] for i in range(dense)]
        + ["streets"] * maps
    )
    patterns = np.stack([_stretched(rng, texture(rng, kind, photos)) for kind in kinds]).astype(np.float32)
    levels = [patterns]
    while levels[-1].shape[1] > 1:
        fine = levels[-1]
        levels.append(0.25 * (fine[:, ::2, ::2] + fine[:, 1::2, ::2] + fine[:, ::2, 1::2] + fine[:, 1::2, 1::2]))
    offsets = np.cumsum([0, *(level.size for level in levels)])[:-1]
    texels = np.concatenate([level.ravel() for level in levels]).astype(np.float32)
    ranges = np.split(np.arange(plain + dense + maps), (plain, plain + dense))
    return TextureBank(texels, offsets.astype(np.int64), *ranges)


def _stretched(rng: np.random.Generator, pattern: F8) -> F8:
    """Random gamma, sometimes inverted: dark on bright and bright on dark."""
    pattern = 1 - pattern if rng.random() < 0.5 else pattern
    return pattern ** np.exp(rng.normal() * 0.5)
