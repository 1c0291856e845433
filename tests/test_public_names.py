import subprocess
import sys

import pytest

import evimo
from evimo.errors import MissingExtra, how_to_install

NAMES = {
    "Camera",
    "Estimate",
    "Events",
    "evaluate",
    "evaluate_predictions",
    "load_camera",
    "load_model",
    "open_events",
    "open_recording",
    "run",
}


def in_new_process(code: str) -> str:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout


def test_these_and_no_others():
    assert set(evimo.__all__) == NAMES
    assert set(dir(evimo)) >= NAMES


@pytest.mark.parametrize("name", sorted(NAMES))
def test_each_is_there(name):
    assert getattr(evimo, name).__name__ == name


def test_others_are_not():
    with pytest.raises(AttributeError, match="no attribute 'walk'"):
        _ = evimo.walk


def test_importing_loads_nothing_and_running_needs_no_torch():
    code = """
import sys
import evimo
heavy = {'numpy', 'numba', 'cv2', 'onnxruntime', 'h5py', 'torch'}
assert not heavy & set(sys.modules), heavy & set(sys.modules)
evimo.run, evimo.open_events, evimo.Camera
import evimo.streaming.saving
assert 'torch' not in sys.modules
print('fine')
"""
    assert in_new_process(code) == "fine\n"


def test_load_model_says_which_extra_it_needs(monkeypatch):
    monkeypatch.delitem(vars(evimo), "load_model", raising=False)
    monkeypatch.setattr("evimo.errors.find_spec", lambda name: None)
    with pytest.raises(MissingExtra, match="needs torch and safetensors") as raised:
        _ = evimo.load_model
    assert raised.value.fix == how_to_install("train")
