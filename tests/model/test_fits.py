import pytest
import torch

from evimo.geometry.motion_field import motion_field
from evimo.geometry.poses import se3_exp
from evimo.model.first_pass import TwistPrior
from evimo.model.fits import Geometry, Prior, fitted, residual_translations, robustly_fitted, solved

TWIST = torch.tensor([0.3, -0.2, 0.4, 0.1, -0.3, 0.2]).double()
FOCAL_PX = torch.tensor([50.0, 45.0]).double().view(1, 2, 1, 1)
FREE = Prior(torch.zeros(1, 6).double(), torch.full((1, 6), 1e-12).double())


@pytest.fixture
def geometry(rng):
    """Random inverse depth (1, 1, 12, 16) and the grid of a wide lens."""
    y, x = torch.meshgrid(torch.linspace(-0.5, 0.5, 12), torch.linspace(-0.7, 0.7, 16), indexing="ij")
    depth = 1 + 3 * torch.rand(1, 1, 12, 16, generator=rng).double()
    return Geometry(1 / depth, torch.stack((x, y))[None].double(), FOCAL_PX)


@pytest.fixture
def weight():
    return torch.ones(1, 1, 12, 16).double()


def seen_flow(twists, geometry):
    """Flow (1, 2, H, W), px, of points that cameras of these twists (6,) or (H, W, 6) see while they really move."""
    x, y, z = geometry.grid[0, 0], geometry.grid[0, 1], 1 / geometry.inv_depth[0, 0]
    points = torch.stack((x * z, y * z, z, torch.ones_like(z)), dim=-1)[..., None]
    twists = twists.expand(*z.shape, 6)

    def at(dt_s):
        moved = torch.linalg.inv(se3_exp(twists * dt_s)) @ points
        return (moved[..., :2, 0] / moved[..., 2:3, 0]).movedim(-1, 0)[None]

    return (at(1e-5) - at(-1e-5)) / 2e-5 * geometry.focal_px


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


def test_the_basis_says_what_the_motion_field_says(geometry):
    by_basis = torch.einsum("n,bnchw->bchw", TWIST, geometry.basis)
    expected = motion_field(TWIST.view(1, 6, 1, 1), geometry.inv_depth, geometry.grid)
    torch.testing.assert_close(by_basis, expected)
    torch.testing.assert_close(geometry.rigid_flow(TWIST[None]), expected * FOCAL_PX)


def test_the_twist_of_a_really_moving_camera_is_found(geometry, weight):
    flow = seen_flow(TWIST, geometry)
    torch.testing.assert_close(fitted(geometry, flow, weight, FREE)[0], TWIST, atol=1e-4, rtol=0)
    torch.testing.assert_close(robustly_fitted(geometry, flow, weight, FREE)[0], TWIST, atol=1e-4, rtol=0)


def test_what_has_no_weight_has_no_say(geometry, weight):
    flow = seen_flow(TWIST, geometry)
    flow[..., :8] = 7
    weight[..., :8] = 0
    torch.testing.assert_close(fitted(geometry, flow, weight, FREE)[0], TWIST, atol=1e-3, rtol=0)


def test_no_weight_gives_the_priors_mean(geometry, weight):
    flow = seen_flow(TWIST, geometry)
    prior = Prior(2 * TWIST[None], torch.full((1, 6), 1e-2).double())
    torch.testing.assert_close(fitted(geometry, flow, 0 * weight, prior)[0], 2 * TWIST)
    torch.testing.assert_close(robustly_fitted(geometry, flow, 0 * weight, prior)[0], 2 * TWIST)


def test_a_prior_pulls_to_its_mean(geometry, weight):
    flow = seen_flow(TWIST, geometry)
    for mean in (torch.zeros(6).double(), 3 * TWIST):
        found = [
            fitted(geometry, flow, weight, Prior(mean[None], torch.full((1, 6), precision).double()))[0]
            for precision in (1e-2, 1, 1e3)
        ]
        away = [(one - mean).norm().item() for one in found]
        assert away[0] > away[1] > away[2]
        assert away[2] < 0.01


def test_a_known_rotation_wins(geometry, weight, rng):
    flow = seen_flow(TWIST, geometry) + torch.randn(1, 2, 12, 16, generator=rng).double() * 20
    known = torch.cat((TWIST[3:], torch.ones(1).double()))[None]
    prior = TwistPrior().double()
    with torch.no_grad():
        told = robustly_fitted(geometry, flow, weight, prior(known))[0]
        untold = robustly_fitted(geometry, flow, weight, prior(0 * known))[0]
    torch.testing.assert_close(told[3:], TWIST[3:], atol=2e-3, rtol=0)
    assert (untold[3:] - TWIST[3:]).norm() > 20 * (told[3:] - TWIST[3:]).norm()


def test_an_unknown_rotation_is_free_whatever_stands_in_its_place(geometry, weight):
    prior = TwistPrior().double()
    nonsense = torch.tensor([[9.0, 9, 9, 0]]).double()
    with torch.no_grad():
        one, other = (fitted(geometry, seen_flow(TWIST, geometry), weight, prior(r)) for r in (nonsense, 0 * nonsense))
    torch.testing.assert_close(one, other)


@pytest.fixture
def with_movers(geometry, rng):
    """Flow of which three in ten pixels are 25 px off."""
    flow = seen_flow(TWIST, geometry)
    return flow + 25.0 * (torch.rand(1, 1, 12, 16, generator=rng) < 0.3)


def test_three_in_ten_movers_lose_their_say(geometry, weight, with_movers):
    plain = (fitted(geometry, with_movers, weight, FREE)[0] - TWIST).norm()
    robust = (robustly_fitted(geometry, with_movers, weight, FREE)[0] - TWIST).norm()
    assert robust < 0.65 * plain


def test_from_a_good_guess_they_have_even_less(geometry, weight, with_movers):
    far = (robustly_fitted(geometry, with_movers, weight, FREE, guess=0 * TWIST[None])[0] - TWIST).norm()
    near = (robustly_fitted(geometry, with_movers, weight, FREE, guess=TWIST[None])[0] - TWIST).norm()
    assert near < 0.65 * far


@pytest.mark.parametrize("share", [1.0, 0.4])
def test_translations_times_their_shares_are_found(share, geometry, weight):
    """Two objects that fill a third of the image each, said with a probability of `share`."""
    mixture = torch.zeros(1, 3, 12, 16).double()
    mixture[:, 1, :, :5] = mixture[:, 2, :, 11:] = share
    mixture[:, 0] = 1 - mixture[:, 1:].sum(1)
    planted = torch.tensor([[0.2, -0.5, 0.1], [-0.3, 0.1, 0.4]]).double()
    twists = TWIST.expand(12, 16, 6).clone()
    twists[..., :3] += torch.einsum("jhw,jd->hwd", mixture[0, 1:], planted)
    error = seen_flow(twists, geometry) - seen_flow(TWIST, geometry)
    tight = torch.tensor(1e-12).double()
    found = residual_translations(geometry, error, mixture, weight=weight, prior=tight)
    torch.testing.assert_close(found[0], planted, atol=1e-5, rtol=0)
    # A weight of nothing on half of each object changes nothing, and spoiled flow there does not either.
    weight[:, :, :6], error[:, :, :6] = 0, 99
    found = residual_translations(geometry, error, mixture, weight=weight, prior=tight)
    torch.testing.assert_close(found[0], planted, atol=1e-5, rtol=0)


def test_where_no_object_is_nothing_moves(geometry, weight):
    mixture = torch.zeros(1, 3, 12, 16).double()
    mixture[:, 0] = 1
    error = torch.full((1, 2, 12, 16), 5.0).double()
    found = residual_translations(geometry, error, mixture, weight=weight, prior=torch.tensor(1e-3).double())
    assert not found.any()
