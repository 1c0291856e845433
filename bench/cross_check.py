"""Our event pixel beside an independent simulator, on the same frames, both without noise: docs/cross_check.md.

    python bench/cross_check.py v2e --checkout ~/v2e
    python bench/cross_check.py evlib

Prints events of each, pixels whose events differ in number or polarity, and differences of time. None of their code is
part of evimo: v2e is taken from your checkout, evlib from your environment.
"""

import argparse
import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from unittest.mock import MagicMock

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadInput, MissingExtra, NotFound
from evimo.events.events import Events, joined
from evimo.simulate.pixels import Pixels
from evimo.simulate.sensor import SensorSettings

F4, F8 = NDArray[np.float32], NDArray[np.float64]

SIZE = (130, 173)
CONTRAST = 0.2
TIME_S: F8 = 0.05 + np.arange(41) * 1.47e-3
CLEAN = SensorSettings(
    contrast=CONTRAST,
    mismatch=0.0,
    refractory_s=0.0,
    bandwidth_hz=0.0,
    floor=0.0,
    shot_hz=0.0,
    leak_hz=0.0,
    jitter_s=0.0,
    blur_px=0.0,
)
# What v2e imports for windows and files, neither of which is opened here.
WINDOWS_AND_FILES = (
    "screeninfo", "easygui", "engineering_notation", "plyer", "dv_processing", "line_profiler", "h5py", "matplotlib",
    "matplotlib.pyplot", "tkinter", "tkinter.filedialog", "numba", "tqdm",
)  # fmt: skip


def film() -> F4:
    """Waves that run across each other, (F, H, W), in the 25 to 240 of an 8-bit camera; v2e is linear below 20."""
    y, x = np.mgrid[: SIZE[0], : SIZE[1]]
    rng = np.random.default_rng(346)
    wave = np.zeros((len(TIME_S), *SIZE))
    for across, down, hz, phase in rng.uniform((-0.5, -0.5, 2, 0), (0.5, 0.5, 25, 6.3), (9, 4)):
        wave += np.sin(across * x + down * y + phase + 2 * np.pi * hz * TIME_S[:, None, None])
    level = np.tanh(wave / 3) * 0.5 + 0.5
    return np.exp(np.log(25) + level * np.log(240 / 25)).astype(np.float32)


def ours(frames: F4) -> Events:
    """Events of our pixels, which have memorised the first frame."""
    pixels = Pixels(CLEAN, np.random.default_rng(0), first=frames[0], start_s=TIME_S[0])
    pixels.state.gap[:] = 0
    return pixels.events(frames, TIME_S)


def of_v2e(frames: F4, checkout: Path | None) -> Events:
    """Events of v2e's emulator in clean mode, from the user's checkout."""
    if checkout is None or not (checkout / "v2ecore" / "emulator.py").exists():
        raise NotFound(f"no v2e in {checkout}", fix="--checkout FOLDER, a clone of the repository SensorsINI/v2e")
    sys.path.insert(0, str(checkout))
    for name in WINDOWS_AND_FILES:
        try:
            importlib.import_module(name)
        except ImportError:
            sys.modules[name] = MagicMock()
    emulator = importlib.import_module("v2ecore.emulator").EventEmulator(
        pos_thres=CONTRAST,
        neg_thres=CONTRAST,
        sigma_thres=0,
        cutoff_hz=0,
        leak_rate_hz=0,
        refractory_period_s=0,
        shot_noise_rate_hz=0,
        device="cpu",
    )
    found = [emulator.generate_events(frame, t) for frame, t in zip(frames, TIME_S.tolist(), strict=True)]
    return _events([part.T[[1, 2, 0, 3]] for part in found if part is not None and len(part)])


def of_evlib(frames: F4, checkout: Path | None) -> Events:
    """Events of the ESIM in evlib, which gives all events of a frame the frame's time."""
    try:
        simulation = importlib.import_module("evlib.simulation")
    except ImportError as error:
        raise MissingExtra("evlib is not installed", fix="pip install evlib torch") from error
    settings = simulation.ESIMConfig(
        positive_threshold=CONTRAST, negative_threshold=CONTRAST, refractory_period_ms=0.0, device="cpu"
    )
    simulator = simulation.ESIMSimulator(settings)
    found = [simulator.process_frame(frame, t) for frame, t in zip(frames, TIME_S.tolist(), strict=True)]
    return _events([np.stack(part) for part in found if len(part[0])])


OTHERS: dict[str, Callable[[F4, Path | None], Events]] = {"v2e": of_v2e, "evlib": of_evlib}


def _events(parts: list[NDArray[np.float64]]) -> Events:
    """From columns, rows, seconds and polarities (4, N)."""
    return joined(
        [
            Events(
                x.astype(np.uint16), y.astype(np.uint16), np.rint(t * 1e6).astype(np.int64), np.sign(p).astype(np.int8)
            )
            for x, y, t, p in parts
        ]
    )


def by_pixel(events: Events) -> Events:
    """Pixel after pixel, each in order of time."""
    order = np.lexsort((np.arange(len(events)), events.t, events.x, events.y))
    return Events(events.x[order], events.y[order], events.t[order], events.p[order])


def counts(events: Events) -> NDArray[np.int64]:
    """Events of each polarity and pixel, (2, H, W)."""
    table = np.zeros((2, *SIZE), np.int64)
    np.add.at(table, ((events.p > 0).astype(int), events.y, events.x), 1)
    return table


def compared(mine: Events, other: Events) -> dict[str, float]:
    """How alike two lists of events are; times where the pixels' numbers agree."""
    table, others = counts(mine), counts(other)
    unlike = (table != others).any(axis=0)
    one, two = by_pixel(mine), by_pixel(other)
    late = two.t[~unlike[two.y, two.x]] - one.t[~unlike[one.y, one.x]]
    low, middle, high = np.percentile(late, (5, 50, 95)) * 1e-3 if len(late) else (np.nan,) * 3
    return {
        "our events": len(mine),
        "its events": len(other),
        "pixels with other counts": int(unlike.sum()),
        "pixels": unlike.size,
        "its times later by, ms, p5": low,
        "p50": middle,
        "p95": high,
    }


def main() -> None:
    """Parse, simulate twice, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("simulator", choices=OTHERS)
    parser.add_argument("--checkout", type=Path, help="of v2e")
    options = parser.parse_args()
    frames = film()
    try:
        other = OTHERS[options.simulator](frames, options.checkout)
    except (BadInput, MissingExtra, NotFound) as error:
        sys.exit(str(error))
    for name, value in compared(ours(frames), other).items():
        print(f"{name:>28}: {value:,.3f}" if isinstance(value, float) else f"{name:>28}: {value:,}")


if __name__ == "__main__":
    main()
