import pytest
import torch

from evimo.geometry.motion_field import motion_field
from evimo.model.fits import fitted, flow_per_twist
from evimo.model.pose_net import Geometry, cues, explained, rigid_flow, soft

EGO = torch.tensor([[0.01, -0.008, 0.006, 0.004, -0.006, 0.01]])  # per slice
FREE = torch.full((6,), 1e-7)


@pytest.fixture
def geometry(rng):
    y, x = torch.meshgrid(torch.linspace(-0.5, 0.5, 12), torch.linspace(-0.7, 0.7, 16), indexing="ij")
    inv_depth = 1 / (0.5 + torch.rand(1, 1, 12, 16, generator=rng))
    focal_px = torch.tensor([60.0, 50.0]).view(1, 2, 1, 1)
    return Geometry(inv_depth, torch.stack((x, y))[None], focal_px, torch.ones(1, 1, 12, 16))


def trusted(geometry):
    return torch.tensor([1.0, 0, 1]).view(1, 3, 1, 1).expand(1, 3, *geometry.grid.shape[-2:])


def test_rigid_flow_is_the_motion_field_in_px(geometry):
    expected = motion_field(EGO[..., None, None], geometry.inv_depth, geometry.grid) * geometry.focal_px
    torch.testing.assert_close(rigid_flow(EGO, geometry), expected)


@pytest.mark.parametrize("guess", [None, EGO * 0.7])
def test_what_moves_by_itself_loses_its_say(geometry, guess):
    flow = rigid_flow(EGO, geometry)
    flow[:, 0, 3:9, 4:10] += 1.5  # 36 of 192 pixels
    ego, _ = explained(flow, trusted(geometry), geometry, FREE, guess)
    plain = fitted(
        flow_per_twist(geometry.inv_depth, geometry.grid), flow / geometry.focal_px, trusted(geometry)[:, None], FREE
    )
    missed, missed_plainly = (rigid_flow(one - EGO, geometry).abs().mean() for one in (ego, plain[:, 0]))
    assert missed < 0.4 * missed_plainly


def test_what_is_explained_leaves_the_floor_only(geometry):
    ego, square = explained(rigid_flow(EGO, geometry), trusted(geometry), geometry, FREE, None)
    torch.testing.assert_close(ego, EGO, atol=2e-4, rtol=0)
    assert square.item() == pytest.approx(0.0025, abs=1e-3)


def test_soft_is_linear_for_slow_and_bounded_for_fast_motion():
    values = soft(torch.tensor([0.001, -0.001, 1e6, -1e6]), knee=2.0)
    torch.testing.assert_close(values, torch.tensor([0.001, -0.001, 2, -2]), atol=1e-5, rtol=0)


def test_cues_are_zero_where_everything_is_explained_and_nothing_moves():
    nothing = torch.zeros(1, 2, 3, 4)
    found = cues(nothing, nothing, torch.full((1, 1, 1, 1), 0.0025))
    assert found.shape == (1, 7, 3, 4)
    assert found.abs().max() < 0.002
