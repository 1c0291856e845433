from pathlib import Path

import pytest
import torch

from evimo.geometry.grids import pixel_grid
from evimo.geometry.warping import (
    EventPoints,
    image_of_warped_events,
    inside,
    resized_points,
    sample,
    splat,
)

SRC = Path(__file__).parents[2] / "src"


def test_convention_one_function_calls_grid_sample():
    calls = {file.name: file.read_text().count("grid_sample(") for file in SRC.rglob("*.py")}
    assert {name: count for name, count in calls.items() if count} == {"warping.py": 1}


@pytest.fixture
def generator():
    return torch.Generator().manual_seed(0)


@pytest.fixture
def image(generator):
    return torch.rand(1, 2, 3, 4, dtype=torch.float64, generator=generator)


def events_at(*rows, dtype=torch.float64):
    """Events from rows of (x, y, t, polarity) of sample 0."""
    x, y, t, p = torch.tensor(rows, dtype=dtype).reshape(-1, 4).unbind(-1)
    return EventPoints(torch.zeros(len(x), dtype=torch.long), x, y, t, p > 0)


def constant_flow(u, v, size=(3, 4)):
    return torch.tensor([u, v], dtype=torch.float64).view(1, 2, 1, 1).expand(1, 2, *size)


def splat_one(x, y, weight=1.0):
    xy = torch.tensor([[x, y]], dtype=torch.float64)
    plane = torch.zeros(1, dtype=torch.long)
    return splat(xy, torch.full((1,), weight, dtype=torch.float64), (1, 3, 4), plane=plane)[0]


def test_sampling_at_every_pixel_is_the_image(image):
    torch.testing.assert_close(sample(image, pixel_grid(image)[None]), image)


def test_sample_undoes_a_known_shift(image):
    shifted = torch.roll(image, shifts=(1, 2), dims=(-2, -1))  # content moves one row down and two columns right
    at = pixel_grid(image)[None] + torch.tensor([2.0, 1.0]).view(1, 2, 1, 1)
    came_from_inside = inside(at, (3, 4)).expand_as(image)
    assert came_from_inside[0, 0].sum() == 2 * 2
    torch.testing.assert_close(sample(shifted, at)[came_from_inside], image[came_from_inside])
    assert (sample(shifted, at)[~came_from_inside] == 0).all()


def test_convention_sampling_at_corner_zero_reads_the_first_pixel_and_halfway_the_mean(image):
    at = torch.tensor([[0.0, 0.5, 3.0], [0.0, 0.0, 2.0]], dtype=torch.float64).view(1, 2, 1, 3)
    read = sample(image, at)[0, 0, 0]
    expected = torch.stack((image[0, 0, 0, 0], (image[0, 0, 0, 0] + image[0, 0, 0, 1]) / 2, image[0, 0, 2, 3]))
    torch.testing.assert_close(read, expected)


def test_an_image_of_one_pixel_can_be_sampled():
    assert sample(torch.ones(1, 1, 1, 1), torch.zeros(1, 2, 1, 1)).item() == 1


def test_splat_by_hand_on_a_3x4_grid():
    assert splat_one(2.25, 1.5).tolist() == [[0, 0, 0, 0], [0, 0, 0.375, 0.125], [0, 0, 0.375, 0.125]]
    assert splat_one(3, 2, 5.0).tolist() == [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 5]]


def test_splat_is_the_transpose_of_sample(image, generator):
    xy = torch.rand(50, 2, dtype=torch.float64, generator=generator) * torch.tensor([5.0, 4.0]) - 1
    weight = torch.rand(50, dtype=torch.float64, generator=generator)
    splatted = splat(xy, weight, (1, 3, 4), plane=torch.zeros(50, dtype=torch.long))[0]
    read = sample(image[:, :1], xy.T.view(1, 2, 1, 50)).flatten()
    torch.testing.assert_close((splatted * image[0, 0]).sum(), (weight * read).sum())


def test_splat_keeps_the_mass_of_what_stays_inside(generator):
    xy = torch.rand(100, 2, dtype=torch.float64, generator=generator) * torch.tensor([3.0, 2.0])
    weight = torch.rand(100, dtype=torch.float64, generator=generator)
    plane = torch.arange(100) % 2
    image = splat(xy, weight, (2, 3, 4), plane=plane)
    for k in range(2):
        torch.testing.assert_close(image[k].sum(), weight[plane == k].sum())


def test_half_outside_keeps_half():
    assert splat_one(-0.5, 0).tolist() == [[0.5, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]]
    assert splat_one(-2, 0).sum() == 0


def test_events_move_back_along_the_flow_to_the_reference_time():
    events = events_at((0, 0, -1, 1), (1, 1, 0, 1), (2, 2, 1, 1), (3, 0, 0, -1))
    image = image_of_warped_events(constant_flow(1, 1), events)[0]
    assert image[0].tolist() == [[0, 0, 0, 0], [0, 3, 0, 0], [0, 0, 0, 0]]
    assert image[1].tolist() == [[0, 0, 0, 1], [0, 0, 0, 0], [0, 0, 0, 0]]


def test_each_event_follows_the_flow_of_its_own_pixel_and_sample():
    flow = torch.zeros(2, 2, 3, 4, dtype=torch.float64)
    flow[1, 0, 2, 3] = 2
    events = events_at((3, 2, 1, 1), (3, 2, 1, 1), (0, 0, 1, 1))._replace(batch=torch.tensor([0, 1, 1]))
    image = image_of_warped_events(flow, events)
    assert image[:, 0].nonzero().tolist() == [[0, 2, 3], [1, 0, 0], [1, 2, 1]]


def test_an_event_that_would_leave_stays_where_it_was():
    events = events_at((0, 0, 1, 1), (3, 2, -1, -1), (1, 1, 1, 1))
    image = image_of_warped_events(constant_flow(1.5, 0.5), events)
    assert image.sum() == 3
    assert image[0, 0, 0, 0] == 1 and image[0, 1, 2, 3] == 1
    torch.testing.assert_close(image_of_warped_events(constant_flow(1e9, 0), events), _unwarped(events))


def _unwarped(events):
    return image_of_warped_events(constant_flow(0, 0), events)


def test_an_undefined_flow_moves_nothing():
    events = events_at((1, 1, 1, 1), (2, 1, 1, 1))
    flow = constant_flow(0, 0).clone()
    flow[..., 1, 1] = float("nan")
    torch.testing.assert_close(image_of_warped_events(flow, events), _unwarped(events))


def test_no_events_make_an_empty_image():
    assert image_of_warped_events(constant_flow(1, 1), events_at()).abs().sum() == 0


def test_resized_points_follow_the_pixel_centres():
    events = events_at((0, 0, 0, 1), (3, 5, 0, 1), (4, 4, 0, 1))
    halved = resized_points(events, (6, 8), (3, 4))
    assert halved.x.tolist() == [
        0,
        1.25,
        1.75,
    ]  # pixels 0 and 1 share the first pixel of the half image, at -0.25 and 0.25
    assert halved.y.tolist() == [0, 2, 1.75]


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_the_type_is_kept(dtype):
    events = events_at((1, 1, 1, 1), dtype=dtype)
    assert image_of_warped_events(constant_flow(0.5, 0).to(dtype), events).dtype == dtype


def test_gradients(image, generator):
    at = (torch.rand(1, 2, 3, 4, dtype=torch.float64, generator=generator) * 2).requires_grad_()
    assert torch.autograd.gradcheck(sample, (image.requires_grad_(), at))
    xy = (torch.rand(6, 2, dtype=torch.float64, generator=generator) * 2).requires_grad_()
    weight = torch.rand(6, dtype=torch.float64, generator=generator).requires_grad_()
    plane = torch.arange(6) % 2
    assert torch.autograd.gradcheck(lambda p, w: splat(p, w, (2, 3, 4), plane=plane), (xy, weight))
    flow = torch.rand(1, 2, 3, 4, dtype=torch.float64, generator=generator).requires_grad_()
    events = events_at((1.2, 1, 0.3, 1), (2, 0.9, -0.4, 1), (2.2, 1.8, 0.5, -1))
    assert torch.autograd.gradcheck(lambda f: image_of_warped_events(f, events), (flow,))
