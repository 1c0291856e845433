import numpy as np
import pytest
import torch

from evimo.geometry.motion_field import motion_field
from evimo.streaming.nearby import static_flow


@pytest.mark.parametrize("axis", range(6))
def test_static_flow_is_the_motion_field(axis):
    rng = np.random.default_rng(axis)
    lens = np.array([200.0, 210.0, 80.0, 60.0])
    x, y, depth = rng.uniform(0, 160, 50), rng.uniform(0, 120, 50), rng.uniform(0.2, 3, 50)
    ego = np.eye(6)[axis] + 0.1 * rng.normal(size=6)
    grid = torch.from_numpy(np.stack(((x - lens[2]) / lens[0], (y - lens[3]) / lens[1]))[:, None])
    inverse = torch.from_numpy(1 / depth)[None, None]
    twist = torch.from_numpy(ego)[:, None, None].expand(6, 1, 50)
    expected = motion_field(twist, inverse, grid)[:, 0].numpy() * lens[:2, None]
    found = np.array([static_flow(*point, ego, lens) for point in zip(x, y, depth, strict=True)]).T
    np.testing.assert_allclose(found, expected, rtol=1e-9)
