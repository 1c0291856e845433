import math

import pytest
import torch
from pytest import approx

from evimo.losses.mask import balance, dice_loss, mask_loss, one_sided_mask_loss


def row(*values):
    return torch.tensor(values, dtype=torch.float64).view(1, 1, 1, -1)


def truth(*values):
    return torch.tensor(values).bool().view(1, 1, 1, -1)


MOVING = truth(0, 0, 0, 1)
EVERYWHERE = truth(1, 1, 1, 1)


def test_right_masks_cost_nothing_and_doubt_costs_its_logarithm():
    assert (mask_loss(row(1.0, 1, 1, 0), MOVING, EVERYWHERE) == 0).all()
    doubtful = mask_loss(row(0.5, 0.25, 1, 0.5), MOVING, EVERYWHERE).flatten()
    expected = torch.tensor([math.log(2), math.log(4), 0, math.log(2)]).double()
    torch.testing.assert_close(doubtful, expected, atol=1e-5, rtol=0)


def test_gradient_raises_the_background_where_still_and_lowers_it_where_moving():
    background = row(0.5, 0.5, 0.5, 0.5).requires_grad_()
    mask_loss(background, MOVING, EVERYWHERE).sum().backward()
    assert background.grad is not None
    assert (background.grad.sign() == row(-1.0, -1, -1, 1)).all()


def test_all_background_is_free_for_the_paper_and_dear_for_us():
    lazy = row(1.0, 1, 1, 1)
    assert one_sided_mask_loss(lazy, MOVING, EVERYWHERE).sum().item() == 0
    assert mask_loss(lazy, MOVING, EVERYWHERE).sum() > 10
    torch.testing.assert_close(  # on the background both are the paper's
        one_sided_mask_loss(row(0.3, 0.6, 0.9, 0.5), MOVING, EVERYWHERE)[..., :3],
        mask_loss(row(0.3, 0.6, 0.9, 0.5), MOVING, EVERYWHERE)[..., :3],
    )


@pytest.mark.parametrize("loss", [mask_loss, one_sided_mask_loss])
def test_a_saturated_softmax_keeps_a_finite_gradient(loss):
    logits = torch.tensor([[-200.0, 0.0], [0.0, -200.0]]).T.reshape(1, 2, 1, 2).requires_grad_()
    background = logits.softmax(1)[:, :1]  # 0 and 1
    loss(background, truth(0, 1), truth(1, 1)).sum().backward()
    assert logits.grad is not None and logits.grad.isfinite().all()


@pytest.mark.parametrize("loss", [mask_loss, one_sided_mask_loss, dice_loss])
def test_unknown_pixels_leave_no_trace(loss):
    valid = truth(1, 0, 1, 0)
    costs = [loss(row(0.5, m, 0.5, m), MOVING, valid).sum() for m in (0.2, 0.9)]
    assert costs[0] == costs[1]
    background = row(0.5, float("nan"), 0.5, 0.5).requires_grad_()
    loss(background, MOVING, valid).sum().backward()
    assert background.grad is not None and background.grad[valid].isfinite().all()
    assert (background.grad[~valid] == 0).all()


def test_balance_gives_movers_their_share_and_keeps_the_mean():
    moving, valid = truth(*[1] * 10, *[0] * 90), truth(*[1] * 100)
    weight = balance(moving, valid, moving_share=0.4)
    assert weight[moving].sum().item() == approx(40)
    assert weight.mean().item() == approx(1)
    assert weight[moving].unique().item() == approx(4) and weight[~moving].unique().item() == approx(60 / 90)


def test_balance_has_a_limit_for_very_small_objects():
    moving, valid = truth(1, *[0] * 999), truth(*[1] * 1000)
    weight = balance(moving, valid, moving_share=0.4, limit=20.0)
    assert weight[moving].item() == approx(20)
    assert weight.sum().item() == approx(1000, rel=1e-5)


@pytest.mark.parametrize("moving", [truth(0, 0, 0), truth(1, 1, 1)], ids=["still", "all move"])
def test_with_one_kind_of_pixel_only_balance_is_one(moving):
    assert balance(moving, truth(1, 1, 1), moving_share=0.4).flatten().tolist() == [1, 1, 1]


def test_balance_ignores_unknown_pixels_and_survives_none():
    weight = balance(truth(1, 1, 0, 0), truth(1, 0, 1, 0), moving_share=0.5)
    assert weight.flatten().tolist() == [1, 0, 1, 0]
    assert balance(truth(1, 0), truth(0, 0), moving_share=0.5).flatten().tolist() == [0, 0]


def test_each_sample_is_balanced_alone():
    moving = torch.cat((truth(1, 0, 0, 0), truth(1, 1, 0, 0)))
    weight = balance(moving, torch.ones_like(moving), moving_share=0.5)
    assert weight[:, 0, 0, 0].tolist() == [2, 1]


def test_dice_is_one_minus_overlap():
    background = row(0.0, 0, 1, 1)
    half = dice_loss(background, truth(0, 1, 1, 0), EVERYWHERE, slack_px=0.0)
    assert half.item() == approx(1 - 2 * 1 / (2 + 2))
    assert dice_loss(background, truth(1, 1, 0, 0), EVERYWHERE).item() == approx(0)


def test_dice_of_an_object_does_not_depend_on_the_size_of_the_frame():
    small = dice_loss(row(0.3, 0.6, 1), truth(1, 1, 0), truth(1, 1, 1))
    large = dice_loss(row(0.3, 0.6, *[1] * 50), truth(1, 1, *[0] * 50), truth(*[1] * 52))
    assert small.item() == approx(large.item())


def test_without_movers_dice_is_zero_for_calling_nothing_and_grows_with_false_alarms():
    still = truth(0, 0, 0, 0)
    costs = [dice_loss(row(1.0, 1, 1, 1 - p), still, EVERYWHERE).item() for p in (0, 0.5, 1)]
    assert costs == approx([0, 1 / 3, 1 / 2])


def test_gradcheck():
    background = row(0.2, 0.7, 0.5, 0.4).requires_grad_()
    for loss in (mask_loss, one_sided_mask_loss, dice_loss):
        assert torch.autograd.gradcheck(lambda m, loss=loss: loss(m, MOVING, truth(1, 1, 0, 1)), (background,))
