import torch

from evimo.losses.smoothness import depth_smoothness, mixture_smoothness


def ramp(height, width, *, x=0.0, y=0.0):
    rows, columns = torch.meshgrid(torch.arange(height).double(), torch.arange(width).double(), indexing="ij")
    return (1 + x * columns + y * rows)[None, None]


def test_a_constant_mixture_is_free():
    assert mixture_smoothness(torch.full((2, 3, 4, 5), 1 / 3)).sum() == 0


def test_a_straight_edge_costs_two_per_pixel_of_its_length():
    object_mask = torch.zeros(1, 1, 6, 8)
    object_mask[..., 2:4, 3:6] = 1  # 2 x 3 pixels: an edge of 10
    cost = mixture_smoothness(torch.cat((1 - object_mask, object_mask), dim=1))
    assert cost.shape == (1, 1, 6, 8)
    assert cost.sum() == 2 * 10


def test_depth_linear_in_the_image_is_free_and_a_bend_costs_its_second_difference():
    assert depth_smoothness(ramp(5, 6, x=0.3, y=-0.2)).abs().max() < 1e-12
    bend = ramp(1, 5)
    bend[..., 2:] += torch.tensor([1.0, 2.0, 3.0])  # slope 0, then 1, from column 1 on
    assert depth_smoothness(bend).flatten().tolist() == [0, 1, 0, 0, 0]
    assert depth_smoothness(bend.mT).flatten().tolist() == [0, 1, 0, 0, 0]


def test_gradient_flattens_a_spike():
    depth = ramp(5, 5)
    depth[..., 2, 2] += 1
    depth.requires_grad_()
    depth_smoothness(depth).sum().backward()
    assert depth.grad is not None
    assert depth.grad[0, 0, 2, 2] > 0 > depth.grad[0, 0, 2, 1]


def test_images_too_small_for_a_difference_are_free():
    assert mixture_smoothness(torch.rand(1, 2, 1, 1)).tolist() == [[[[0.0]]]]
    for size in ((1, 1), (2, 2), (1, 5)):
        cost = depth_smoothness(torch.rand(1, 1, *size))
        assert cost.shape == (1, 1, *size)
    assert depth_smoothness(torch.rand(1, 1, 2, 2)).sum() == 0


def test_gradcheck():
    values = torch.rand(1, 2, 4, 4, dtype=torch.float64, generator=torch.Generator().manual_seed(0)).requires_grad_()
    assert torch.autograd.gradcheck(mixture_smoothness, (values,))
    assert torch.autograd.gradcheck(lambda v: depth_smoothness(v[:, :1]), (values,))
