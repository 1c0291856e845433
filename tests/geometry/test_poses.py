import math

import pytest
import torch

from evimo.geometry.poses import se3_exp, se3_log, so3_exp, so3_log

ANGLES = {"zero": 0.0, "tiny": 1e-9, "near": 1e-4, "seam": 0.5, "far": 2.0, "nearly half a turn": math.pi - 1e-6}


def directions(count=20, seed=0):
    axes = torch.randn(count, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))
    axes = torch.cat((axes, torch.eye(3).double(), -torch.eye(3).double()))
    return axes / axes.norm(dim=-1, keepdim=True)


def twists(angle, seed=0):
    axes = directions(seed=seed)
    return torch.cat((directions(seed=seed + 1) * 3, axes * angle), dim=-1)


def tangent_matrix(twist):
    """4x4 generator of a twist: its columns are what it does to the axes and to the origin."""
    v, w = twist[..., :3], twist[..., 3:]
    columns = [torch.linalg.cross(w, axis.expand_as(w)) for axis in torch.eye(3).to(twist)] + [v]
    return torch.cat((torch.stack(columns, dim=-1), torch.zeros(*twist.shape[:-1], 1, 4).to(twist)), dim=-2)


def close(actual, expected, atol=1e-12):
    torch.testing.assert_close(actual, expected, atol=atol, rtol=0)


@pytest.fixture(params=ANGLES.values(), ids=ANGLES.keys())
def angle(request):
    return request.param


def test_exp_equals_the_matrix_exponential(angle):
    expected = torch.linalg.matrix_exp(tangent_matrix(twists(angle)))
    close(se3_exp(twists(angle)), expected)
    close(so3_exp(twists(angle)[..., 3:]), expected[..., :3, :3])


def test_rotations_are_closed(angle):
    matrix = so3_exp(directions() * angle) @ so3_exp(directions(seed=1) * 1.3)
    close(matrix @ matrix.mT, torch.eye(3).double().expand_as(matrix))
    close(torch.linalg.det(matrix), torch.ones(len(matrix)).double())
    close(so3_exp(so3_log(matrix)), matrix, atol=1e-9)


def test_inverse_is_the_exp_of_minus_the_tangent(angle):
    motion = se3_exp(twists(angle)) @ se3_exp(-twists(angle))
    close(motion, torch.eye(4).double().expand_as(motion), atol=1e-11)


def test_log_undoes_exp(angle):
    close(so3_log(so3_exp(directions() * angle)), directions() * angle, atol=2e-9)
    close(se3_log(se3_exp(twists(angle))), twists(angle), atol=2e-8)


def test_half_a_turn_has_either_axis():
    matrix = so3_exp(directions() * math.pi)
    rotation = so3_log(matrix)
    close(rotation.norm(dim=-1), torch.full((len(rotation),), math.pi, dtype=torch.float64))
    close(so3_exp(rotation), matrix)


def test_more_than_half_a_turn_comes_back_the_short_way():
    about_z = torch.tensor([0, 0, math.pi / 2], dtype=torch.float64)
    close(so3_log(so3_exp(3 * about_z)), -about_z)


def test_small_rotations_keep_their_digits_in_float32():
    rotation = directions().float() * 1e-6
    torch.testing.assert_close(so3_log(so3_exp(rotation)), rotation, rtol=1e-6, atol=0)


def test_convention_twist_is_translation_then_rotation_in_the_bodys_own_axes():
    quarter_turn_on_a_circle = torch.tensor([1.0, 0, 0, 0, 0, 1]).double() * (math.pi / 2)  # forward x, turning to y
    expected = torch.tensor([[0.0, -1, 0, 1], [1, 0, 0, 1], [0, 0, 1, 0], [0, 0, 0, 1]]).double()
    close(se3_exp(quarter_turn_on_a_circle), expected)


@pytest.mark.parametrize("batch", [(), (2,), (2, 3), (0,)])
def test_any_batch_shape(batch):
    twist = torch.randn(*batch, 6, dtype=torch.float64, generator=torch.Generator().manual_seed(0)) * 0.5
    motion = se3_exp(twist)
    assert motion.shape == (*batch, 4, 4)
    close(se3_log(motion), twist, atol=1e-10)


@pytest.mark.parametrize("scale", [0.0, 1e-7, 0.3, 2.5])
def test_gradients(scale):
    twist = (twists(1.0)[:4] * scale).requires_grad_()
    assert torch.autograd.gradcheck(se3_exp, (twist,))
    assert torch.autograd.gradcheck(lambda t: se3_log(se3_exp(t)), (twist,))
