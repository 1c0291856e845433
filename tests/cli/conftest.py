"""A fake network and a text recording for commands."""

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest

MAKER = Path(__file__).parents[1] / "streaming" / "fake_network.py"


@pytest.fixture(scope="session")
def fake_network(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Path of the fake network of tests/streaming."""
    spec = spec_from_file_location("fake_network", MAKER)
    assert spec and spec.loader
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.save_fake_network(tmp_path_factory.mktemp("model") / "fake.onnx")


def save_text(path: Path, *, seconds: float, per_second: int) -> Path:
    """A square of ON events that moves right across 32x24 pixels, as rows t x y p with t in µs."""
    rng = np.random.default_rng(0)
    count = int(seconds * per_second)
    t_us = np.sort(rng.integers(0, round(seconds * 1e6), count))
    x = (t_us // 50_000 + rng.integers(0, 6, count)) % 32
    rows = np.stack((5_000_000 + t_us, x, rng.integers(8, 14, count), np.ones_like(t_us)), axis=1)
    np.savetxt(path, rows, fmt="%d")
    return path


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Half a second, 20 slices."""
    return save_text(tmp_path / "square.txt", seconds=0.51, per_second=4000)


@pytest.fixture
def long_recording(tmp_path: Path) -> Path:
    """One minute, 2400 slices."""
    return save_text(tmp_path / "long.txt", seconds=60.0, per_second=2000)
