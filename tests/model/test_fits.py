import pytest
import torch

from evimo.geometry.motion_field import motion_field
from evimo.geometry.poses import se3_exp
from evimo.model.fits import fitted, flow_per_twist, mismatch, solved

TWIST = torch.tensor([0.3, -0.2, 0.4, 0.1, -0.3, 0.2]).double()
OTHER = torch.tensor([-0.6, 0.5, 0.1, 0.0, 0.0, 0.0]).double()
FREE = torch.full((6,), 1e-9).double()


@pytest.fixture
def scene(rng):
    """Random inverse depth (1, 1, 12, 16) and the grid (1, 2, 12, 16) of a wide lens."""
    y, x = torch.meshgrid(torch.linspace(-0.5, 0.5, 12), torch.linspace(-0.7, 0.7, 16), indexing="ij")
    depth = 1 + 3 * torch.rand(1, 1, 12, 16, generator=rng).double()
    return 1 / depth, torch.stack((x, y))[None].double()


def seen_flow(twist, inv_depth, grid):
    """Flow (1, 2, H, W) of points that a really moving camera sees."""
    x, y, z = grid[0, 0].flatten(), grid[0, 1].flatten(), 1 / inv_depth.flatten()
    points = torch.stack((x * z, y * z, z, torch.ones_like(z)))

    def at(dt_s):
        moved = torch.linalg.inv(se3_exp(twist * dt_s)) @ points
        return (moved[:2] / moved[2]).view_as(grid)

    return (at(1e-5) - at(-1e-5)) / 2e-5


def isotropic(grid):
    """Weight 1 for every error: the identity as (xx, xy, yy)."""
    return torch.tensor([1.0, 0, 1]).double().view(1, 1, 3, 1, 1).expand(1, 1, 3, *grid.shape[-2:])


@pytest.mark.parametrize("size", [3, 6])
def test_solved_is_what_torch_solves(size, rng):
    root = torch.randn(2, 4, size, size, generator=rng).double()
    matrix = root @ root.mT + 0.1 * torch.eye(size).double()
    right = torch.randn(2, 4, size, 1, generator=rng).double()
    torch.testing.assert_close(solved(matrix, right), torch.linalg.solve(matrix, right), atol=1e-8, rtol=1e-8)


def test_solved_can_be_differentiated(rng):
    root = torch.randn(6, 6, generator=rng).double()

    def of_root(root, right):  # gradcheck moves one number at a time; a matrix must stay symmetric
        return solved(root @ root.mT + torch.eye(6), right)

    assert torch.autograd.gradcheck(of_root, (root.requires_grad_(), torch.ones(6, 1).double().requires_grad_()))


def test_solved_is_exact_enough_in_float32_where_motions_are_hard_to_tell_apart(rng):
    root = torch.randn(2, 6, 6, generator=rng).double()
    root[:, 3:] = root[:, :3] + 0.1 * root[:, 3:]  # a narrow view: turning looks like moving sideways
    matrix = root @ root.mT + 0.003 * torch.eye(6)
    right = torch.randn(2, 6, 1, generator=rng).double()
    found = solved(matrix.float(), right.float()).double()
    torch.testing.assert_close(matrix @ found, right, atol=2e-3, rtol=2e-3)


def test_the_matrix_of_equation_1_says_what_the_motion_field_says(scene):
    inv_depth, grid = scene
    by_matrix = torch.einsum("n,bnchw->bchw", TWIST, flow_per_twist(inv_depth, grid))
    torch.testing.assert_close(by_matrix, motion_field(TWIST.view(1, 6, 1, 1), inv_depth, grid))


def test_the_twist_of_a_really_moving_camera_is_found(scene):
    found = fitted(flow_per_twist(*scene), seen_flow(TWIST, *scene), isotropic(scene[1]), FREE)
    torch.testing.assert_close(found[0, 0], TWIST, atol=1e-6, rtol=0)


def test_each_channel_of_weights_has_its_own_answer(scene):
    flow = seen_flow(TWIST, *scene)
    flow[..., 9:] = seen_flow(OTHER, *scene)[..., 9:]
    left = torch.zeros(1, 1, 1, 12, 16).double()
    left[..., :9] = 1
    weight = torch.cat((left, 1 - left), dim=1) * isotropic(scene[1])
    found = fitted(flow_per_twist(*scene), flow, weight, FREE)
    torch.testing.assert_close(found[0], torch.stack((TWIST, OTHER)), atol=1e-5, rtol=0)


def test_an_edge_tells_nothing_of_motion_along_it(scene, rng):
    flow = seen_flow(TWIST, *scene)
    flow[:, 1, :, ::2] += torch.randn(1, 12, 8, generator=rng).double()  # along upright edges anything may be seen
    weight = isotropic(scene[1]).clone()
    weight[:, :, 2, :, ::2] = 0
    found = fitted(flow_per_twist(*scene), flow, weight, FREE)
    torch.testing.assert_close(found[0, 0], TWIST, atol=1e-6, rtol=0)


def test_a_slanted_edge_is_the_same_in_other_axes(scene, rng):
    flow = seen_flow(TWIST, *scene)
    along = torch.tensor([0.6, 0.8]).double()
    flow[..., ::2] += torch.randn(1, 1, 12, 8, generator=rng).double() * along.view(1, 2, 1, 1)
    weight = isotropic(scene[1]).clone()
    weight[..., ::2] = torch.tensor([0.64, -0.48, 0.36]).double().view(1, 1, 3, 1, 1)  # across (0.8, -0.6)
    found = fitted(flow_per_twist(*scene), flow, weight, FREE)
    torch.testing.assert_close(found[0, 0], TWIST, atol=1e-6, rtol=0)


def test_no_weight_gives_no_motion_and_a_prior_pulls_to_0(scene):
    basis, flow = flow_per_twist(*scene), seen_flow(TWIST, *scene)
    nothing = fitted(basis, flow, 0 * isotropic(scene[1]), FREE + 1e-3)
    assert nothing.abs().max() == 0
    pulled = fitted(basis, flow, isotropic(scene[1]), FREE + 1)
    assert pulled.norm() < 0.9 * TWIST.norm()


def test_mismatch_is_the_quadratic_form(rng):
    error, weight = (torch.randn(1, channels, 2, 3, generator=rng) for channels in (2, 3))
    matrix = weight[0, [0, 1, 1, 2]].unflatten(0, (2, 2))
    expected = torch.einsum("ihw,ijhw,jhw->hw", error[0], matrix, error[0])
    torch.testing.assert_close(mismatch(error, weight)[0, 0], expected)
