"""Textures cut from photographs: those inside an installed package, and a user's own."""

import math
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile, MissingExtra, NotFound
from evimo.formats.pictures import read_picture
from evimo.scene.own_files import own_files

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
Photos = tuple[F4, ...]
"""Grey pictures (H, W) in 0...1."""

TRAINING = ("astronaut.png", "brick.png", "camera.png", "chelsea.png", "coins.png", "gravel.png", "ihc.png", "moon.png")
TESTING = ("cell.png", "clock_motion.png", "coffee.png", "grass.png", "motorcycle_left.png", "rocket.jpg", "text.png")
INSTALLED = {0: TRAINING, 1: TRAINING, 2: TESTING}
"""Files in the wheel of scikit-image, by pool: what is filmed without a pool never shows what the test pool does."""

SUFFIXES = (".png", ".jpg", ".jpeg")
LEAST_SIDE, MOST_SIDE = 32, 512  # px of a photo
SMALLEST_CROP = 0.25  # of the shorter side
LEAST_RANGE = 0.2  # of a crop's grey levels; flatter ones are drawn again
ATTEMPTS = 10
SEAM = 0.15  # of a texture, over which its ends are blended
MIRRORED = 0.2  # share that tiles by mirroring
OWN = 0.5  # share of crops from the user's photos, if there are any


@lru_cache(maxsize=4)
def installed(pool: int) -> Photos:
    """The photos of one pool.

    Raises:
        NotFound: this scikit-image came without one of them.
    """
    spec = find_spec("skimage")
    if spec is None or not spec.submodule_search_locations:
        raise MissingExtra("natural textures are cut from the photographs of scikit-image", extra="simulate")
    folder = Path(spec.submodule_search_locations[0]) / "data"
    return tuple(_photo(folder / name) for name in INSTALLED[pool])


def textures_of(folder: Path) -> list[F4]:
    """Every PNG and JPEG directly in a folder, by name: grey pictures (H, W) in 0...1, large ones shrunk.

    Raises:
        NotFound: there is no such folder, or no picture in it.
        BadFile: a picture cannot be read or is smaller than 32 pixels.
    """
    files = own_files(folder, SUFFIXES, what="pictures").files
    return [_shrunk(_photo(file)) for file in files]


@lru_cache(maxsize=4)
def own_photos(folder: Path, pool: int) -> Photos:
    """A user's photos for one pool: all without a pool, else every other one, by name."""
    photos = textures_of(folder)
    return tuple(photos[pool - 1 :: 2] if pool else photos)


def _photo(file: Path) -> F4:
    if not file.is_file():
        raise NotFound(f"no picture {file}", fix="another version of scikit-image, or the file put back")
    grey = read_picture(file, cv2.IMREAD_GRAYSCALE)
    if grey is None or min(grey.shape) < LEAST_SIDE:
        raise BadFile(f"{file} is no picture of at least {LEAST_SIDE} pixels", fix="another picture, or remove it")
    return (grey / np.float32(255)).astype(np.float32)


def _shrunk(photo: F4) -> F4:
    """A photo of at most MOST_SIDE pixels along its shorter side: hundreds from a camera would not fit in memory."""
    share = MOST_SIDE / min(photo.shape)
    if share >= 1:
        return photo
    size = round(photo.shape[1] * share), round(photo.shape[0] * share)
    return cv2.resize(photo, size, interpolation=cv2.INTER_AREA).astype(np.float32)


def cut(rng: np.random.Generator, photos: Photos, own: Photos, size: int) -> F8:
    """A random crop of a random photo, turned, stretched to 0...1, (size, size), tiling in both directions."""
    crop = np.zeros((1, 1), np.float32)
    low, high = 0.0, 1.0
    for _ in range(ATTEMPTS):
        source = own if own and (not photos or rng.random() < OWN) else photos
        crop = _crop(rng, source[rng.integers(len(source))])
        low, high = np.percentile(crop, (1, 99))
        if high - low > LEAST_RANGE:
            break
    crop = np.clip((crop - low) / max(high - low, 1e-3), 0, 1)
    crop = np.rot90(crop, int(rng.integers(4)))
    crop = crop[:, ::-1] if rng.random() < 0.5 else crop
    return _mirrored(crop, size) if rng.random() < MIRRORED else _blended(crop, size)


def _crop(rng: np.random.Generator, photo: F4) -> F4:
    side = round(min(photo.shape) * math.exp(rng.uniform(math.log(SMALLEST_CROP), 0)))
    top, left = (int(rng.integers(0, length - side + 1)) for length in photo.shape)
    return photo[top : top + side, left : left + side]


def _resized(crop: F4, side: int) -> F8:
    how = cv2.INTER_AREA if side < len(crop) else cv2.INTER_LINEAR
    return cv2.resize(np.ascontiguousarray(crop), (side, side), interpolation=how).astype(np.float64)


def _mirrored(crop: F4, size: int) -> F8:
    quarter = _resized(crop, size // 2)
    half = np.concatenate((quarter, quarter[:, ::-1]), axis=1)
    return np.concatenate((half, half[::-1]))


def _blended(crop: F4, size: int) -> F8:
    """What lies beyond the right and lower end fades into the left and upper one."""
    seam = round(size * SEAM)
    wide, share = _resized(crop, size + seam), np.linspace(0, 1, seam)
    wide[:, :seam] = share * wide[:, :seam] + (1 - share) * wide[:, size:]
    wide[:seam] = share[:, None] * wide[:seam] + (1 - share[:, None]) * wide[size:]
    return wide[:size, :size]
