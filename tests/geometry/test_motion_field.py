import pytest
import torch

from evimo.geometry.motion_field import motion_field, pixel_residual, pixel_twist
from evimo.geometry.poses import se3_exp

HEIGHT, WIDTH = 4, 5


@pytest.fixture
def generator():
    return torch.Generator().manual_seed(0)


@pytest.fixture
def grid():
    y, x = torch.meshgrid(torch.linspace(-0.4, 0.5, HEIGHT), torch.linspace(-0.7, 0.6, WIDTH), indexing="ij")
    return torch.stack((x, y)).double()


@pytest.fixture
def depth(generator):
    return 0.5 + 2 * torch.rand(1, HEIGHT, WIDTH, dtype=torch.float64, generator=generator)


def unproject(grid, depth):
    """Homogeneous points (4, H*W) seen at the grid."""
    return torch.cat((grid * depth, depth, torch.ones_like(depth))).flatten(1)


def project(points):
    return points[:2] / points[2]


def rate(position_at, step_s=1e-5):
    return (position_at(step_s) - position_at(-step_s)) / (2 * step_s)


@pytest.mark.parametrize("axis", range(6))
def test_motion_field_is_what_a_moving_camera_sees(axis, grid, depth):
    twist = torch.eye(6, dtype=torch.float64)[axis]
    points = unproject(grid, depth)

    def seen_after(dt_s):
        cam_from_start = torch.linalg.inv(se3_exp(twist * dt_s))
        return project(cam_from_start @ points).view_as(grid)

    torch.testing.assert_close(motion_field(twist[:, None, None], 1 / depth, grid), rate(seen_after), atol=1e-8, rtol=0)


@pytest.mark.parametrize("axis", range(3))
def test_convention_object_with_velocity_w_has_residual_translation_minus_w(axis, grid, depth, generator):
    ego = torch.randn(6, dtype=torch.float64, generator=generator)
    velocity = torch.eye(3, dtype=torch.float64)[axis]
    points = unproject(grid, depth)
    left_half = (torch.arange(WIDTH) < 2).expand(HEIGHT, WIDTH)

    def seen_after(dt_s):
        moved = points.clone()
        moved[:3] += velocity[:, None] * dt_s * left_half.flatten()  # the camera's axes at the start
        return project(torch.linalg.inv(se3_exp(ego * dt_s)) @ moved).view_as(grid)

    mixture = torch.stack((~left_half, left_half)).double()
    twist = pixel_twist(ego, -velocity[None], mixture)
    torch.testing.assert_close(motion_field(twist, 1 / depth, grid), rate(seen_after), atol=1e-7, rtol=0)


def test_a_camera_at_rest_sees_no_motion(grid, depth):
    assert (motion_field(torch.zeros(6, 1, 1).double(), 1 / depth, grid) == 0).all()


def test_infinitely_far_points_move_by_rotation_only(grid):
    far = torch.zeros(1, HEIGHT, WIDTH).double()
    turning = torch.tensor([0, 0, 0, 0.1, -0.2, 0.3]).double()
    also_moving = torch.tensor([9.0, 9, 9, 0.1, -0.2, 0.3]).double()
    fields = [motion_field(twist[:, None, None], far, grid) for twist in (turning, also_moving)]
    torch.testing.assert_close(*fields)


def test_scale_of_depth_and_translation_cannot_be_seen(grid, depth, generator):
    twist = torch.randn(6, 1, 1, dtype=torch.float64, generator=generator)
    larger = torch.cat((twist[:3] * 7, twist[3:]))
    torch.testing.assert_close(motion_field(larger, 1 / (7 * depth), grid), motion_field(twist, 1 / depth, grid))


def test_mixture_shares_out_the_residuals():
    residual = torch.tensor([[1.0, 0, 0], [0, 2, 0]])
    mixture = torch.tensor([0.5, 0.25, 0.25]).view(3, 1, 1)
    assert pixel_residual(residual, mixture).flatten().tolist() == [0.25, 0.5, 0]
    ego = torch.arange(6.0)
    assert pixel_twist(ego, residual, mixture).flatten().tolist() == [0.25, 1.5, 2, 3, 4, 5]


@pytest.mark.parametrize("batch", [(), (2,), (2, 3)])
def test_any_batch_shape(batch, grid, generator):
    ego, residual = (torch.randn(*batch, *shape, dtype=torch.float64, generator=generator) for shape in ((6,), (3, 3)))
    mixture = torch.randn(*batch, 4, HEIGHT, WIDTH, dtype=torch.float64, generator=generator).softmax(-3)
    inv_depth = torch.rand(*batch, 1, HEIGHT, WIDTH, dtype=torch.float64, generator=generator)
    flow = motion_field(pixel_twist(ego, residual, mixture), inv_depth, grid)
    assert flow.shape == (*batch, 2, HEIGHT, WIDTH)
    one = (0,) * len(batch)
    alone = motion_field(pixel_twist(ego[one], residual[one], mixture[one]), inv_depth[one], grid)
    torch.testing.assert_close(flow[one], alone)
    torch.testing.assert_close(flow, motion_field(pixel_twist(ego, residual, mixture), inv_depth, grid.expand_as(flow)))


def test_gradients(grid, depth, generator):
    ego, residual = (torch.randn(*shape, dtype=torch.float64, generator=generator) for shape in ((2, 6), (2, 3, 3)))
    mixture = torch.randn(2, 4, HEIGHT, WIDTH, dtype=torch.float64, generator=generator).softmax(1)
    inputs = [tensor.requires_grad_() for tensor in (ego, residual, mixture, 1 / depth)]
    assert torch.autograd.gradcheck(lambda e, r, m, i: motion_field(pixel_twist(e, r, m), i[None], grid), inputs)
