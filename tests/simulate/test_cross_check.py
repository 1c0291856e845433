"""Our pixel beside other simulators: golden counts that two of them gave too, and the command of the documentation."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

SCRIPT = Path(__file__).parents[2] / "bench" / "cross_check.py"
COUNTED = 227_651  # by us, by evlib 0.13.2 and by the class of rpg_davis_simulator alike, in every pixel


@pytest.fixture(scope="module")
def script():
    spec = importlib.util.spec_from_file_location("cross_check", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def frames(script):
    return script.film()


@pytest.fixture(scope="module")
def ours(script, frames):
    return script.ours(frames)


def test_counts_are_still_those_of_other_simulators(ours):
    """Sines and logarithms may differ in the last digit on another processor."""
    assert len(ours) == pytest.approx(COUNTED, abs=5)
    assert (ours.p > 0).sum() == pytest.approx(113_588, abs=5)


def test_every_level_is_crossed_as_often_as_it_must_be(script, frames, ours):
    """In each pixel, ON less OFF events are the thresholds between where it began and where it is, less the rest."""
    on, off = script.counts(ours)[::-1]
    climbed = (np.log(frames[-1].astype(float)) - np.log(frames[0].astype(float))) / script.CONTRAST
    assert (np.abs(on - off - climbed) < 1 + 1e-4).all()


FAKE = """
import numpy as np
from screeninfo import get_monitors  # not installed: a window's

class EventEmulator:
    def __init__(self, pos_thres, neg_thres, sigma_thres, cutoff_hz, leak_rate_hz, refractory_period_s,
                 shot_noise_rate_hz, device):
        assert pos_thres == neg_thres and not (sigma_thres or cutoff_hz or leak_rate_hz or shot_noise_rate_hz)
        self.threshold, self.memory = pos_thres, None

    def generate_events(self, frame, t):
        level = np.log(frame.astype(float))
        if self.memory is None:
            self.memory = level
            return None
        number = np.trunc((level - self.memory) / self.threshold).astype(int)
        self.memory = self.memory + number * self.threshold
        y, x = np.nonzero(number)
        y, x = (np.repeat(a, np.abs(number[y, x])) for a in (y, x))
        return np.stack((np.full(len(x), t), x, y, np.sign(number[y, x])), axis=1)
"""


def run(*arguments):
    return subprocess.run([sys.executable, str(SCRIPT), *arguments], capture_output=True, text=True, check=False)


def test_the_command_finds_a_checkout_and_counts_alike(tmp_path):
    (tmp_path / "v2ecore").mkdir()
    (tmp_path / "v2ecore" / "emulator.py").write_text(FAKE)
    done = run("v2e", "--checkout", str(tmp_path))
    assert done.returncode == 0, done.stderr
    said = dict(line.strip().split(": ") for line in done.stdout.splitlines())
    assert said["our events"] == said["its events"]
    assert int(said["pixels with other counts"]) == 0
    assert 0 < float(said["p50"]) < 1.47  # it knows no time within a frame


def test_without_a_checkout_the_command_says_what_to_do():
    done = run("v2e")
    assert done.returncode != 0
    assert "--checkout" in done.stderr
    assert "Traceback" not in done.stderr


def test_v2e_counts_alike():
    """EVIMO_V2E=FOLDER pytest tests/simulate/test_cross_check.py, with a clone of v2e."""
    checkout = os.environ.get("EVIMO_V2E")
    if not checkout:
        pytest.skip("needs EVIMO_V2E, the folder of a clone of v2e")
    done = run("v2e", "--checkout", checkout)
    assert done.returncode == 0, done.stderr
    said = dict(line.strip().split(": ") for line in done.stdout.splitlines() if ": " in line)
    assert said["our events"] == said["its events"]
    assert int(said["pixels with other counts"]) == 0
