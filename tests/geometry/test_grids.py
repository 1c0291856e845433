import pytest
import torch

from evimo.geometry.camera import Camera
from evimo.geometry.grids import normalised_grid, pixel_grid, resized_intrinsics

SIZE = (6, 8)
INTRINSICS = torch.tensor([7.0, 6.5, 3.1, 2.6], dtype=torch.float64)


def as_camera(intrinsics, size):
    return Camera(*intrinsics.tolist(), *size)


def image_of(size):
    return torch.zeros(1, *size, dtype=torch.float64)


def test_convention_x_is_the_column_and_integers_are_pixel_centres():
    grid = pixel_grid(torch.zeros(1, 2, 3))
    assert grid[0].tolist() == [[0, 1, 2], [0, 1, 2]]
    assert grid[1].tolist() == [[0, 0, 0], [1, 1, 1]]


def test_grid_agrees_with_the_camera():
    pixels = pixel_grid(image_of(SIZE))
    expected, valid = as_camera(INTRINSICS, SIZE).normalised(pixels.permute(1, 2, 0).numpy())
    assert valid.all()
    grid = normalised_grid(INTRINSICS, image_of(SIZE))
    torch.testing.assert_close(grid, torch.as_tensor(expected).double().permute(2, 0, 1), atol=1e-6, rtol=0)


@pytest.mark.parametrize("new_size", [(3, 4), (2, 3), (12, 24), (6, 8)])
def test_resized_intrinsics_agree_with_the_camera(new_size):
    camera = as_camera(INTRINSICS, SIZE).resized(*new_size)
    expected = torch.tensor([camera.fx, camera.fy, camera.cx, camera.cy]).double()
    torch.testing.assert_close(resized_intrinsics(INTRINSICS, SIZE, new_size), expected)


@pytest.mark.parametrize("new_size", [(3, 4), (2, 4), (12, 24)])
def test_convention_resizing_an_image_of_directions_gives_the_grid_of_the_resized_camera(new_size):
    wide = normalised_grid(INTRINSICS, image_of(SIZE))
    resized = torch.nn.functional.interpolate(
        wide[None], new_size, mode="bilinear", align_corners=False, antialias=False
    )[0]
    expected = normalised_grid(resized_intrinsics(INTRINSICS, SIZE, new_size), image_of(new_size))
    inner = (slice(None), slice(2, -2), slice(2, -2)) if new_size[0] > SIZE[0] else ...  # clamped at the border
    torch.testing.assert_close(resized[inner], expected[inner])


def test_there_and_back_is_the_identity():
    there = resized_intrinsics(INTRINSICS, SIZE, (5, 3))
    torch.testing.assert_close(resized_intrinsics(there, (5, 3), SIZE), INTRINSICS)


@pytest.mark.parametrize("batch", [(), (2,), (2, 3), (0,)])
def test_any_batch_shape(batch):
    grid = normalised_grid(INTRINSICS.expand(*batch, 4), image_of(SIZE))
    assert grid.shape == (*batch, 2, *SIZE)
    assert grid.dtype == torch.float64
    torch.testing.assert_close(grid, normalised_grid(INTRINSICS, image_of(SIZE)).expand_as(grid))


def test_gradients():
    assert torch.autograd.gradcheck(
        lambda k: normalised_grid(k, image_of((2, 3))), (INTRINSICS.clone().requires_grad_(),)
    )
