"""The shapes written in signatures of torch code are checked while tests run (pyproject.toml switches it on)."""

import pytest
import torch

from evimo.geometry.motion_field import motion_field


def test_a_wrong_shape_is_refused():
    twist, inv_depth, grid = torch.zeros(6, 1, 1), torch.ones(1, 4, 5), torch.zeros(2, 4, 5)
    assert motion_field(twist, inv_depth, grid).shape == (2, 4, 5)
    with pytest.raises(Exception, match="inv_depth"):
        motion_field(twist, torch.ones(2, 4, 5), grid)
