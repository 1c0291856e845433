import math

import pytest
import torch
from pytest import approx

from evimo.geometry.warping import EventPoints
from evimo.losses.warp import coarse_warp_loss, fine_warp_loss, sharpness

SIZE = (12, 30)
ELAPSED_S = torch.tensor([-0.025, 0, 0.025], dtype=torch.float64)


def constant_flow(u, v=0.0):
    return torch.tensor([u, v]).double().view(1, 2, 1, 1).repeat(1, 1, *SIZE)


def events(x, y, t, positive=True, batch=0):
    x, t = torch.as_tensor(x).double(), torch.as_tensor(t).double()
    fill = torch.ones_like(x)
    return EventPoints((fill * batch).long(), x, fill * y, t, fill.bool() & positive)


def dot(speed=1.0, start=10.0):
    """Ten events of a dot that moves to the right at `speed` px/s and is at `start` at time 0."""
    t = torch.arange(10.0)
    return events(start + speed * t, 5, t)


def fine(flow, points, **options):
    return fine_warp_loss(flow, points, **options).mean().item()


def test_true_flow_makes_the_sharpest_image():
    assert fine(constant_flow(1.0), dot()) == approx(10**0.5 / 10, rel=0.02)  # ten events in one pixel
    assert fine(constant_flow(0.0), dot()) == approx(1, rel=0.02)  # one event in each of ten pixels
    wrong = [fine(constant_flow(speed), dot()) for speed in (0.25, 0.5, 0.75, 1.25, 1.5)]
    assert min(wrong) > 1.3 * 10**0.5 / 10


@pytest.mark.parametrize("speed", [0.93, 1.07])
def test_gradient_points_to_the_true_flow(speed):
    flow = constant_flow(speed).requires_grad_()
    fine_warp_loss(flow, dot()).mean().backward()
    assert flow.grad is not None
    assert flow.grad[:, 0].sum() * (speed - 1) > 0


def test_polarities_do_not_help_each_other():
    points = dot()
    mixed = points._replace(positive=torch.arange(10) % 2 == 0)
    assert fine(constant_flow(1.0), mixed) == approx(2 * 5**0.5 / 10, rel=0.02)


def joined(*many):
    return EventPoints(*(torch.cat(column) for column in zip(*many, strict=True)))


def test_warping_content_out_of_the_frame_does_not_pay():
    cluster = events([10.0] * 9, 5, [0.0] * 9)
    alone_at_the_border = events([28.0], 5, [1.0])
    both = joined(cluster, alone_at_the_border)
    stays, leaves = constant_flow(0.0), constant_flow(-5.0)
    # Divided by the events kept, leaving would pay: 3/9 against (3 + 1)/10.
    assert fine(leaves, both) == approx(fine(stays, both)) == approx(0.4, rel=0.02)
    assert fine(constant_flow(1e6), dot()) == approx(fine(constant_flow(0.0), dot()))


def test_the_loss_is_per_event():
    once = dot()
    many = joined(*[once._replace(y=once.y + k) for k in range(-4, 5)])
    assert fine(constant_flow(1.0), many) == approx(fine(constant_flow(1.0), once))


def test_samples_do_not_mix():
    flow = torch.cat((constant_flow(1.0), constant_flow(0.0)))
    points = joined(dot(), dot()._replace(batch=torch.ones(10, dtype=torch.long)))
    loss = fine_warp_loss(flow, points).mean(dim=(1, 2, 3))
    assert loss.tolist() == approx([10**-0.5, 1], rel=0.02)


def test_no_events_cost_nothing():
    flow = constant_flow(1.0).requires_grad_()
    loss = fine_warp_loss(flow, events([], 0, []))
    loss.mean().backward()
    assert loss.abs().sum() == 0
    assert flow.grad is not None and (flow.grad == 0).all()


def test_fine_gradcheck():
    generator = torch.Generator().manual_seed(0)
    flow = torch.randn(1, 2, 4, 5, dtype=torch.float64, generator=generator).requires_grad_()
    x = torch.rand(8, generator=generator).double() + 1.3
    points = events(x, 1.6, torch.linspace(-0.4, 0.4, 8))
    assert torch.autograd.gradcheck(lambda f: fine_warp_loss(f, points, epsilon=0.01), (flow,))


def test_sharpness_is_zero_for_nothing_and_has_a_finite_slope_there():
    empty = torch.zeros(2, 3).double().requires_grad_()
    value = sharpness(empty)
    value.sum().backward()
    assert (value == 0).all()
    assert empty.grad is not None and empty.grad.max().item() == approx(0.5 / math.sqrt(1e-4))


def moving_frames(shift_px):
    """Three slices of one bright column that moves `shift_px` to the right per slice of 25 ms; all three channels."""
    frames = torch.zeros(1, 3, 3, *SIZE, dtype=torch.float64)
    for n in range(3):
        frames[:, n, :, :, 15 + (n - 1) * shift_px] = 1
    return frames


EVERYWHERE = torch.ones(1, 1, *SIZE, dtype=torch.bool)


def coarse(frames, flow, valid=EVERYWHERE):
    return coarse_warp_loss(frames, flow, valid, elapsed_s=ELAPSED_S)


def test_true_flow_aligns_the_neighbours():
    assert coarse(moving_frames(2), constant_flow(2 / 0.025)).abs().max() < 1e-9
    still = coarse(moving_frames(2), constant_flow(0.0))
    # In each row both neighbours miss the middle's column and show their own: 2 x 2 differences / 2 neighbours.
    assert still.sum().item() == approx(SIZE[0] * 2)


@pytest.mark.parametrize("speed", [1.5 / 0.025, 2.5 / 0.025])
def test_coarse_gradient_points_to_the_true_flow(speed):
    flow = constant_flow(speed).requires_grad_()
    coarse(moving_frames(2), flow).mean().backward()
    assert flow.grad is not None
    assert flow.grad[:, 0].sum() * (speed - 2 / 0.025) > 0


def test_looking_out_of_the_frame_pays_no_better_than_claiming_no_motion():
    frames = moving_frames(2)
    out = coarse(frames, constant_flow(1e6))
    torch.testing.assert_close(out, coarse(frames, constant_flow(0.0)))
    assert out.sum() > coarse(frames, constant_flow(2 / 0.025)).sum()


def test_invalid_pixels_are_neither_judged_nor_looked_at():
    frames, valid = moving_frames(2), EVERYWHERE.clone()
    valid[..., :5] = False
    flow = constant_flow(2 / 0.025)
    spoilt = frames.clone()
    spoilt[:, 2, ..., :5] = 9  # shifted by 2 these would be seen at columns 0...2, all of them invalid
    spoilt[:, 0, ..., 3] = 9  # and these at column 5, which is valid
    loss = coarse(spoilt, flow, valid)
    assert loss.abs().max() < 1e-9


def test_a_slice_without_events_takes_no_part():
    frames = moving_frames(2)
    frames[:, 0] = 0
    assert coarse(frames, constant_flow(2 / 0.025)).abs().max() < 1e-9
    assert coarse(frames, constant_flow(0.0)).sum().item() == approx(SIZE[0] * 2)
    frames[:, 2] = 0
    assert coarse(frames, constant_flow(0.0)).abs().sum() == 0


def test_coarse_gradcheck():
    generator = torch.Generator().manual_seed(0)
    frames = torch.rand(1, 3, 3, 4, 5, dtype=torch.float64, generator=generator)
    flow = (torch.randn(1, 2, 4, 5, dtype=torch.float64, generator=generator) * 20).requires_grad_()
    valid = torch.ones(1, 1, 4, 5, dtype=torch.bool)
    assert torch.autograd.gradcheck(lambda f: coarse_warp_loss(frames, f, valid, elapsed_s=ELAPSED_S), (flow,))
