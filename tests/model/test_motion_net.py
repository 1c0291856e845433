import pytest
import torch
from torch.nn.functional import avg_pool2d, pad

from evimo.geometry.grids import normalised_grid
from evimo.model.motion_net import MotionNet, Prediction, mean_one
from evimo.model.presets import PRESETS


@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize("size", [(47, 61), (33, 90)])
def test_shapes_at_every_scale(name, size, stack):
    model = MotionNet(PRESETS[name]).eval()
    with torch.no_grad():
        predictions = model(*stack(size))
    stride = model.config.stride
    padded = [-(-side // stride) * stride for side in size]
    for prediction, step in zip(predictions, model.config.steps, strict=True):
        height, width = (side // step for side in padded)
        assert prediction.rel_depth.shape == (1, 1, height, width)
        assert prediction.mixture.shape == (1, 4, height, width)
        assert prediction.seen.shape == prediction.flow.shape == (1, 2, height, width)
        assert prediction.object_velocity.shape == (1, 3, height, width)
        assert prediction.ego.shape == (1, 6)
        assert prediction.residual.shape == (1, 3, 3)


def test_mixtures_sum_to_1_and_relative_depth_is_1_on_average(tiny, stack):
    frames, valid, intrinsics = stack((47, 61))
    valid[..., :20] = 0
    for prediction in tiny(frames, valid, intrinsics):
        torch.testing.assert_close(prediction.mixture.sum(1), torch.ones_like(prediction.mixture[:, 0]))
        seen = prediction.valid
        mean = (prediction.rel_depth * seen).sum() / seen.sum()
        assert mean.item() == pytest.approx(1, abs=1e-5)


def test_a_coarse_pixel_looks_where_its_pixels_look_on_average(tiny, stack):
    frames, valid, intrinsics = stack((54, 72))
    fine = normalised_grid(intrinsics, frames[0])
    for prediction, step in zip(tiny(frames, valid, intrinsics), tiny.config.steps, strict=True):
        coarse = normalised_grid(prediction.intrinsics, prediction.rel_depth)
        torch.testing.assert_close(coarse, avg_pool2d(fine, step), atol=1e-6, rtol=1e-5)


def test_padding_is_nothing_but_invalid_pixels_without_events(tiny, stack):
    frames, valid, intrinsics = stack((47, 61))
    ours = tiny(frames, valid, intrinsics)
    theirs = tiny(pad(frames, (0, 11, 0, 7)), pad(valid, (0, 11, 0, 7)), intrinsics)
    for one, other in zip(ours, theirs, strict=True):
        torch.testing.assert_close(one._asdict(), other._asdict(), rtol=0, atol=0)


@pytest.mark.xfail(strict=True, reason="group normalisation and mean contrast count the pixels of a border too")
def test_an_invalid_border_changes_nothing(tiny, stack):
    frames, valid, intrinsics = stack((54, 72))
    with torch.no_grad():
        alone = tiny(frames, valid, intrinsics)[-1]
        bordered = tiny(pad(frames, (0, 18, 0, 18)), pad(valid, (0, 18, 0, 18)), intrinsics)[-1]
    torch.testing.assert_close(alone.mixture, bordered.mixture[..., :27, :36], atol=0.02, rtol=0)


@pytest.mark.parametrize("gone", [[0, 4], [0, 1, 3, 4], [0, 1, 2, 3, 4]])
def test_missing_slices_leave_numbers(gone, tiny, stack):
    frames, valid, intrinsics = stack((36, 54))
    frames[:, gone] = 0
    for prediction in tiny(frames, valid, intrinsics):
        assert all(torch.isfinite(value).all() for value in (*prediction, prediction.flow))


def test_nothing_valid_leaves_numbers(tiny, stack):
    frames, valid, intrinsics = stack((36, 54))
    for prediction in tiny(frames, 0 * valid, intrinsics):
        assert all(torch.isfinite(value).all() for value in (*prediction, prediction.flow))
        assert prediction.residual.abs().max() < 1e-6  # no weight anywhere: no motion


def test_samples_of_a_batch_know_nothing_of_each_other(tiny, stack):
    one, other = stack((36, 54)), stack((36, 54))
    together = tiny(*(torch.cat(pair) for pair in zip(one, other, strict=True)))[-1]
    alone = tiny(*other)[-1]
    torch.testing.assert_close(together.mixture[1:], alone.mixture, atol=1e-4, rtol=1e-4)
    torch.testing.assert_close(together.ego[1:], alone.ego, atol=1e-3, rtol=1e-3)


@pytest.fixture
def prediction(rng):
    """A camera that moves straight on; the second object fills the right half."""
    mixture = torch.zeros(1, 4, 4, 6)
    mixture[:, 0, :, :3] = 1
    mixture[:, 2, :, 3:] = 1
    ego = torch.tensor([[0.3, -0.2, 0.5, 0, 0, 0]])
    residual = torch.zeros(1, 3, 3)
    residual[0, 1] = -ego[0, :3]
    depth = 0.5 + torch.rand(1, 1, 4, 6, generator=rng)
    intrinsics = torch.tensor([[5.0, 5, 2.5, 1.5]])
    return Prediction(depth, ego, residual, mixture, torch.zeros(1, 2, 4, 6), intrinsics, torch.ones(1, 1, 4, 6))


def test_convention_residual_is_minus_the_objects_velocity(prediction):
    expected = prediction.ego[0, :3].view(3, 1, 1).expand(3, 4, 3)
    torch.testing.assert_close(prediction.object_velocity[0, :, :, 3:], expected, atol=1e-5, rtol=1e-5)


def test_what_moves_with_the_camera_stands_still_in_the_image(prediction):
    assert prediction.flow[..., 3:].abs().max() < 1e-6
    assert prediction.flow[..., :3].abs().max() > 0.1


def test_mean_one_of_nothing_is_finite():
    assert torch.isfinite(mean_one(torch.ones(1, 1, 2, 2), torch.zeros(1, 1, 2, 2))).all()
