import torch
from pytest import approx

from evimo.losses.motion import compressed, flow_loss, object_velocity_loss, twist_loss


def field(*vectors):
    """One row of vectors as (1, C, 1, N)."""
    return torch.tensor(vectors, dtype=torch.float64).T.reshape(1, len(vectors[0]), 1, len(vectors))


def known(*values):
    return torch.tensor(values).bool().view(1, 1, 1, -1)


def test_compression_keeps_slow_motion_and_sign_and_bounds_fast_motion():
    flow = torch.tensor([0.0, 0.001, -3.0, 3.0, 1e9]).double()
    assert compressed(flow, knee=3.0).tolist() == approx([0, 0.001, -1.5, 1.5, 3], rel=1e-3)


def test_true_flow_costs_nothing_and_the_gradient_points_to_it():
    truth = field((3.0, 0), (0, -6))
    assert flow_loss(truth, truth, known(1, 1)).sum() == 0
    predicted = torch.zeros_like(truth).requires_grad_()
    loss = flow_loss(predicted, truth, known(1, 1))
    loss.sum().backward()
    assert loss.flatten().tolist() == [1.5, 2]
    assert predicted.grad is not None
    assert predicted.grad[0, 0, 0, 0] == -1 and predicted.grad[0, 1, 0, 1] == 1


def test_a_fast_scene_does_not_drown_a_slow_one():
    missed = flow_loss(field((0.0, 0), (0, 0)), field((1.0, 0), (100, 0)), known(1, 1)).flatten()
    assert missed.tolist() == approx([0.75, 300 / 103])  # 1 : 4 instead of 1 : 100


def test_unknown_flow_leaves_no_trace():
    predicted = field((1.0, 1), (1, 1)).requires_grad_()
    loss = flow_loss(predicted, field((float("nan"), 9), (0, 0)), known(0, 1))
    loss.sum().backward()
    assert loss.flatten().tolist() == [0, 1.5]
    assert predicted.grad is not None
    assert (predicted.grad[..., 0] == 0).all() and (predicted.grad[..., 1] > 0).all()


def test_twist_error_is_in_mean_depths_and_radians_per_second():
    truth = torch.tensor([4.0, 0, 0, 0, 0.3, 0]).double()
    mean_depth = torch.tensor(2.0).double()
    relative = torch.tensor([2.0, 0, 0, 0, 0.3, 0]).double()
    assert twist_loss(relative, truth, mean_depth=mean_depth) == 0
    assert twist_loss(torch.zeros(6).double(), truth, mean_depth=mean_depth).item() == approx(2 + 0.3)


def test_twist_gradient_points_to_the_truth_and_is_finite_at_it():
    truth = torch.tensor([[1.0, 0, 0, 0, 0, 0.5]] * 2).double()
    predicted = torch.stack((torch.zeros(6).double(), truth[0])).requires_grad_()
    twist_loss(predicted, truth, mean_depth=torch.ones(2).double()).sum().backward()
    assert predicted.grad is not None
    assert predicted.grad[0].tolist() == [-1, 0, 0, 0, 0, -1]
    assert (predicted.grad[1] == 0).all()


def test_object_velocity_counts_inside_moving_objects_only():
    predicted = field((3.0, 4, 0), (9, 9, 9)).requires_grad_()
    loss = object_velocity_loss(predicted, torch.zeros_like(predicted), known(1, 0))
    loss.sum().backward()
    assert loss.flatten().tolist() == [5, 0]
    assert predicted.grad is not None
    assert predicted.grad[0, :, 0].T.tolist() == [[0.6, 0.8, 0], [0, 0, 0]]


def test_any_batch_shape_of_twists():
    twists = torch.rand(2, 3, 6)
    assert twist_loss(twists, twists + 1, mean_depth=torch.ones(3)).shape == (2, 3)


def test_gradcheck():
    generator = torch.Generator().manual_seed(0)
    flow, truth = (torch.randn(1, 2, 2, 3, dtype=torch.float64, generator=generator) for _ in range(2))
    valid = known(1, 0, 1).expand(1, 1, 2, 3)
    assert torch.autograd.gradcheck(lambda f: flow_loss(f, truth, valid), (flow.requires_grad_(),))
    twist, other = (torch.randn(2, 6, dtype=torch.float64, generator=generator) for _ in range(2))
    mean_depth = torch.ones(2).double()
    assert torch.autograd.gradcheck(lambda t: twist_loss(t, other, mean_depth=mean_depth), (twist.requires_grad_(),))
