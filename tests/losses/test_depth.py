import torch
from pytest import approx

from evimo.losses.depth import depth_loss, mean_over


def row(*values):
    return torch.tensor(values, dtype=torch.float64).view(1, 1, 1, -1)


def known(*values):
    return torch.tensor(values).view(1, 1, 1, -1)


def test_perfect_depth_costs_one_and_every_error_more():
    truth = row(1.0, 2.0, 5.0)
    everywhere = torch.ones_like(truth).bool()
    assert depth_loss(truth, truth, everywhere).flatten().tolist() == [1, 1, 1]
    for factor in (0.5, 0.99, 1.01, 2):
        assert (depth_loss(truth * factor, truth, everywhere) > 1).all()


def test_half_and_twice_the_depth_by_hand():
    loss = depth_loss(row(1.0, 4.0), row(2.0, 2.0), known(True, True))
    assert loss.flatten().tolist() == [2 + 0.5, 2 + 1]  # ratio plus relative error


def test_gradient_points_to_the_truth():
    predicted = row(1.0, 4.0).requires_grad_()
    depth_loss(predicted, row(2.0, 2.0), known(True, True)).sum().backward()
    assert predicted.grad is not None
    assert predicted.grad[0, 0, 0, 0] < 0 < predicted.grad[0, 0, 0, 1]


def test_unknown_depth_leaves_no_trace_in_the_gradient():
    predicted = torch.tensor([2.0, 2.0]).view(1, 1, 1, 2).requires_grad_()
    truth, valid = torch.tensor([4.0, 0.0]).view(1, 1, 1, 2), torch.tensor([True, False]).view(1, 1, 1, 2)
    depth_loss(predicted, truth, valid).sum().backward()
    assert predicted.grad is not None
    assert predicted.grad.flatten().tolist() == [-1.25, 0.0]


def test_no_valid_pixel_costs_nothing():
    predicted = row(2.0, 3.0).requires_grad_()
    loss = depth_loss(predicted, row(0.0, float("nan")), known(False, False)).sum()
    loss.backward()
    assert loss == 0
    assert predicted.grad is not None and (predicted.grad == 0).all()


def test_gradcheck():
    predicted, truth = row(1.0, 4.0, 3.0).requires_grad_(), row(2.0, 2.0, 0.0)
    assert torch.autograd.gradcheck(lambda p: depth_loss(p, truth, known(True, True, False)), (predicted,))


def test_mean_over_counts_valid_pixels_of_each_sample_only():
    values = torch.cat((row(1.0, 3.0, 100.0), row(5.0, 6.0, 7.0)))
    valid = torch.cat((known(True, True, False), known(True, True, True)))
    assert mean_over(values, valid).flatten().tolist() == [2, 6]


def test_mean_over_nothing_is_one_without_a_gradient():
    values = row(float("nan"), 2.0).requires_grad_()
    mean = mean_over(values, known(False, False))
    mean.sum().backward()
    assert mean.item() == 1
    assert values.grad is not None and (values.grad == 0).all()


def test_depth_divided_by_its_mean_does_not_know_the_scale():
    truth, valid = row(1.0, 2.0, 5.0, 9.0), known(True, True, True, False)
    relative = [depth / mean_over(depth, valid) for depth in (truth, 7 * truth)]
    torch.testing.assert_close(*relative)
    assert mean_over(relative[0], valid).item() == approx(1)
