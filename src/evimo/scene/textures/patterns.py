"""Patterns drawn by rule and cut from photographs: 0...1, tiling in both directions."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from evimo.scene.textures.natural import Photos, cut, installed

F8 = NDArray[np.float64]
SIZE = 256
PLAIN = ("plain", "gradient")
DENSE = (
    "natural", "shapes", "labelled", "lines", "text", "checker", "stripes", "voronoi", "collage", "carpet", "fractal",
    "speckle",
)  # fmt: skip
INNER = ("natural", "natural", "natural", "shapes", "text", "voronoi", "checker", "lines")  # of labels and collages


def texture(rng: np.random.Generator, kind: str, photos: tuple[Photos, Photos] | None = None) -> F8:
    """One pattern (SIZE, SIZE) in 0...1 that tiles in both directions; `photos`: installed ones and a user's own."""
    if kind in _SIMPLE:
        return np.clip(_SIMPLE[kind](rng), 0, 1)
    return np.clip(_COMPOSED[kind](rng, photos or (installed(0), ())), 0, 1)


def _natural(rng: np.random.Generator, photos: tuple[Photos, Photos]) -> F8:
    return cut(rng, *photos, SIZE)


def _grid() -> tuple[F8, F8]:
    y, x = np.mgrid[0:SIZE, 0:SIZE].astype(np.float64)
    return x, y


def _wrapped(distance: F8) -> F8:
    """Signed distance to the nearest copy of a tiled point."""
    return (distance + SIZE / 2) % SIZE - SIZE / 2


def _noise(rng: np.random.Generator, steepness: float) -> F8:
    """Noise with an amplitude spectrum of 1 / frequency^(steepness / 2), through a sigmoid."""
    fy, fx = np.fft.fftfreq(SIZE), np.fft.rfftfreq(SIZE)
    radius = np.hypot(fy[:, None], fx[None])
    radius[0, 0] = 1
    noise = np.fft.irfft2(np.fft.rfft2(rng.normal(size=(SIZE, SIZE))) * radius ** (-steepness / 2), s=(SIZE, SIZE))
    return 1 / (1 + np.exp(-1.5 * (noise - noise.mean()) / noise.std()))


def _blurred(pattern: F8, sigma_px: float) -> F8:
    fy, fx = np.fft.fftfreq(SIZE), np.fft.rfftfreq(SIZE)
    gain = np.exp(-2 * (np.pi * sigma_px) ** 2 * (fy[:, None] ** 2 + fx[None] ** 2))
    return np.fft.irfft2(np.fft.rfft2(pattern) * gain, s=(SIZE, SIZE))


def _plain(rng: np.random.Generator) -> F8:
    return 0.5 + rng.uniform(0.0, 0.04) * (_noise(rng, 2.5) - 0.5)


def _gradient(rng: np.random.Generator) -> F8:
    return 0.5 + rng.uniform(0.03, 0.25) * (_blurred(_noise(rng, 4.0), rng.uniform(12, 32)) - 0.5)


def _fractal(rng: np.random.Generator) -> F8:
    return _noise(rng, rng.uniform(2.2, 3.6))


def _carpet(rng: np.random.Generator) -> F8:
    fibres = np.clip(0.5 + 0.35 * rng.normal(size=(SIZE, SIZE)), 0, 1)
    return _blurred(fibres, rng.uniform(0.8, 2.5)) * 1.5 - 0.25 + 0.3 * (_noise(rng, 3.0) - 0.5)


def _speckle(rng: np.random.Generator) -> F8:
    """Sparse dots on plain ground."""
    dots = (rng.random((SIZE, SIZE)) < rng.uniform(0.0003, 0.003)).astype(float)
    dots = _blurred(dots, sigma := rng.uniform(1.2, 4.0)) * 2 * np.pi * sigma**2
    return 0.15 + 0.8 * np.clip(1.5 * dots, 0, 1)


def _checker(rng: np.random.Generator) -> F8:
    x, y = _grid()
    across, down = 2 * rng.integers(1, 6, 2)
    return (x * across // SIZE + y * down // SIZE) % 2


def _stripes(rng: np.random.Generator) -> F8:
    x, y = _grid()
    waves, slant = rng.integers(2, 16), rng.integers(-2, 3)
    wave = np.sin(2 * np.pi * (waves * x + slant * y) / SIZE)
    return 0.5 + 0.5 * wave if rng.random() < 0.3 else (wave > rng.uniform(-0.6, 0.6)).astype(float)


def _voronoi(rng: np.random.Generator) -> F8:
    x, y = _grid()
    nearest, pattern = np.full((SIZE, SIZE), np.inf), np.zeros((SIZE, SIZE))
    for px, py, grey in rng.uniform(0, (SIZE, SIZE, 1), (rng.integers(6, 36), 3)):
        distance = _wrapped(x - px) ** 2 + _wrapped(y - py) ** 2
        closer = distance < nearest
        nearest[closer], pattern[closer] = distance[closer], grey
    return pattern


def _shapes(rng: np.random.Generator) -> F8:
    x, y = _grid()
    pattern = np.full((SIZE, SIZE), rng.uniform(0.2, 0.8))
    for _ in range(rng.integers(3, 16)):
        dx, dy = _wrapped(x - rng.uniform(0, SIZE)), _wrapped(y - rng.uniform(0, SIZE))
        (long, short), angle = rng.uniform(0.03, 0.25, 2) * SIZE, rng.uniform(0, np.pi)
        u, v = np.cos(angle) * dx + np.sin(angle) * dy, np.cos(angle) * dy - np.sin(angle) * dx
        square = rng.random() < 0.6
        inside = (np.abs(u) < long) & (np.abs(v) < short) if square else (u / long) ** 2 + (v / short) ** 2 < 1
        pattern[inside] = rng.random()
    return pattern


def _text(rng: np.random.Generator) -> F8:
    """Letter-like strokes in rows, as on books, boxes and posters."""
    pattern = np.full((SIZE, SIZE), 0.95)
    row = int(rng.integers(8, 26))
    for y in range(row // 2, SIZE - row + 1, row):
        x = row
        while x < SIZE - row:
            width = int(rng.integers(3, row))
            if rng.random() < 0.8:
                tall, stroke = int(row * 0.6), max(1, width // 4)
                pattern[y : y + tall, x : x + stroke] = 0.05
                bar = y + int(rng.integers(0, max(1, tall - 2)))
                pattern[bar : bar + max(1, row // 8), x : x + width - 1] = 0.05
            x += width + int(rng.integers(1, 4))
    return pattern.T if rng.random() < 0.3 else pattern


def _lines(rng: np.random.Generator) -> F8:
    """A few straight bands on plain ground: tape, seams, slats."""
    x, y = _grid()
    pattern = np.full((SIZE, SIZE), rng.uniform(0.15, 0.85))
    for _ in range(rng.integers(2, 8)):
        across, down = rng.choice([(1, 0), (0, 1), (1, 1), (1, -1), (2, 1), (1, -2)])
        away = (across * x + down * y) / SIZE - rng.random()
        pattern[np.abs(away - np.round(away)) < rng.uniform(0.005, 0.06)] = rng.random()
    return pattern


def _streets(rng: np.random.Generator) -> F8:
    """Streets with dashed middles between blocks of houses and greens: a play mat, or a map."""
    pattern = np.full((SIZE, SIZE), rng.uniform(0.25, 0.45))
    ways = [np.cumsum(rng.integers(34, 62, 8)) for _ in range(2)]
    down, across = ([0, *way[way < SIZE - 30].tolist()] for way in ways)
    wide, kerb, paper = int(rng.integers(9, 15)), rng.uniform(0.6, 0.9), rng.uniform(0.5, 0.8)
    for top, bottom in pairwise([*down, SIZE]):
        for left, right in pairwise([*across, SIZE]):
            pattern[top + wide : bottom, left + wide : right] = kerb
            block = pattern[top + wide + 1 : bottom - 1, left + wide + 1 : right - 1]
            block[:] = rng.choice([paper, rng.random()])
            _fill_block(rng, block)
    dashes = np.arange(SIZE) % 8 < 4
    for top in down:
        pattern[top + wide // 2, dashes] = 0.95
    for left in across:
        pattern[dashes, left + wide // 2] = 0.95
    return pattern


def _fill_block(rng: np.random.Generator, block: F8) -> None:
    """Houses, trees or ponds into one block of streets."""
    height, width = block.shape
    y, x = np.mgrid[0:height, 0:width]
    for _ in range(int(rng.integers(1, 6))):
        (tall, wide), (at_y, at_x) = rng.integers(4, 16, 2), rng.integers(0, (height, width))
        if rng.random() < 0.7:
            block[at_y : at_y + tall, at_x : at_x + wide] = rng.random()
            block[at_y + 2 : at_y + tall - 2, at_x + 2 : at_x + wide - 2] = rng.random()
        else:
            block[(y - at_y) ** 2 + (x - at_x) ** 2 < (tall / 2) ** 2] = rng.random()


def _collage(rng: np.random.Generator, photos: tuple[Photos, Photos]) -> F8:
    """Patches of other patterns beside each other, as on shelves and pinboards."""
    cuts = [np.sort(rng.integers(20, SIZE - 20, 2)).tolist() for _ in range(2)]
    patches = [texture(rng, kind, photos) for kind in (*rng.choice(INNER, 2), "plain")]
    pattern = np.empty((SIZE, SIZE))
    for rows in (slice(0, cuts[0][0]), slice(cuts[0][0], cuts[0][1]), slice(cuts[0][1], SIZE)):
        for columns in (slice(0, cuts[1][0]), slice(cuts[1][0], cuts[1][1]), slice(cuts[1][1], SIZE)):
            base, range_ = rng.uniform(0, 0.6), rng.uniform(0.1, 1)
            pattern[rows, columns] = base + min(range_, 1 - base) * patches[rng.integers(3)][rows, columns]
    return pattern


def _labelled(rng: np.random.Generator, photos: tuple[Photos, Photos]) -> F8:
    """One pattern in a frame on plain ground: a label, a poster, a window."""
    pattern = rng.uniform(0.1, 0.9) + 0.02 * (_noise(rng, 3.0) - 0.5)
    x0, y0 = rng.integers(20, 100, 2)
    x1, y1 = rng.integers(140, 240, 2)
    inner = texture(rng, str(rng.choice(INNER)), photos)[y0:y1, x0:x1]
    border = int(rng.integers(0, 8))
    pattern[y0 - border : y1 + border, x0 - border : x1 + border] = rng.choice([0.05, 0.95])
    pattern[y0:y1, x0:x1] = inner
    return pattern


_SIMPLE: dict[str, Callable[[np.random.Generator], F8]] = {
    "plain": _plain,
    "gradient": _gradient,
    "fractal": _fractal,
    "carpet": _carpet,
    "speckle": _speckle,
    "checker": _checker,
    "stripes": _stripes,
    "voronoi": _voronoi,
    "shapes": _shapes,
    "text": _text,
    "lines": _lines,
    "streets": _streets,
}
_COMPOSED: dict[str, Callable[[np.random.Generator, tuple[Photos, Photos]], F8]] = {
    "natural": _natural,
    "collage": _collage,
    "labelled": _labelled,
}
