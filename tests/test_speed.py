"""What `make bench` compares does the same work."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch", reason="the eager passes need the extra [train]")


def test_both_ways_of_a_pass_say_the_same(monkeypatch):
    monkeypatch.setattr(sys, "path", [str(Path(__file__).parents[1] / "bench"), *sys.path])
    ways = importlib.import_module("speed").ways_of_passes()
    depth, ego, flow = (each[0].numpy() for each in ways["eager_first"]())
    motion = ways["first"]()
    np.testing.assert_allclose(motion.rel_depth, depth[0], atol=1e-3)
    np.testing.assert_allclose(motion.ego, ego, atol=1e-3)
    np.testing.assert_allclose(motion.flow, flow, atol=1e-2)
    moving = ways["eager_second"]()[0][0, 0].numpy()
    np.testing.assert_allclose(ways["second"]().moving, moving, atol=1e-2)
