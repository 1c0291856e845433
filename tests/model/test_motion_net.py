import pytest
import torch
from torch.nn.functional import avg_pool2d

from evimo.geometry.grids import normalised_grid
from evimo.geometry.poses import se3_exp
from evimo.model.first_pass import mean_one
from evimo.model.motion_net import MotionNet, Prediction
from evimo.model.networks import compute_in
from evimo.model.presets import PRESETS
from evimo.model.second_pass import compensation

TWICE = ["base", "small", "tiny"]


def numbers(answer):
    return [value for value in answer if torch.is_tensor(value)]


@pytest.mark.parametrize("name", TWICE)
def test_shapes_of_both_passes(name, look):
    model = MotionNet(PRESETS[name]).eval()
    height, width = model.config.stride, 2 * model.config.stride
    seen = look((height, width))
    with torch.no_grad():
        first, predictions = seen.first(model), seen.second(model)
    quarter = height // 4, width // 4
    assert first.rel_depth.shape == first.valid.shape == (1, 1, *quarter)
    assert first.flow.shape == (1, 2, *quarter)
    assert first.ego.shape == (1, 6)
    assert len(predictions) == model.config.layers + 1
    for step, prediction in zip([2**k for k in range(1, 6)], reversed(predictions), strict=False):
        size = height // step, width // step
        assert prediction.rel_depth.shape == prediction.valid.shape == (1, 1, *size)
        assert prediction.mixture.shape == (1, 4, *size)
        assert prediction.seen.shape == prediction.taken.shape == prediction.flow.shape == (1, 2, *size)
        assert prediction.object_velocity.shape == (1, 3, *size)
        assert prediction.ego.shape == (1, 6)
        assert prediction.residual.shape == (1, 3, 3)


def test_mixtures_sum_to_1_and_relative_depth_is_1_on_average(tiny, look):
    seen = look((64, 96))
    seen.valid[..., :20] = 0
    for prediction in (seen.first(tiny), *seen.second(tiny)):
        mean = (prediction.rel_depth * prediction.valid).sum() / prediction.valid.sum()
        assert mean.item() == pytest.approx(1, abs=1e-5)
        if isinstance(prediction, Prediction):
            torch.testing.assert_close(prediction.mixture.sum(1), torch.ones_like(prediction.mixture[:, 0]))


def test_a_coarse_pixel_looks_where_its_pixels_look_on_average(tiny, look):
    seen = look((64, 96))
    fine = normalised_grid(seen.intrinsics, seen.sharp_voxels)
    for prediction, step in zip(seen.second(tiny), (16, 8, 4, 2), strict=True):
        coarse = normalised_grid(prediction.intrinsics, prediction.rel_depth)
        torch.testing.assert_close(coarse, avg_pool2d(fine, step), atol=1e-6, rtol=1e-5)


@pytest.mark.parametrize("gone", [(0, 4), (0, 1, 3, 4), (0, 1, 2, 3, 4)])
def test_missing_slices_leave_numbers(gone, tiny, look):
    seen = look((64, 96), gone=gone)
    for answer in (seen.first(tiny), *seen.second(tiny)):
        assert all(torch.isfinite(value).all() for value in (*numbers(answer), answer.flow))


def test_nothing_valid_leaves_numbers(tiny, look):
    seen = look((64, 96))._replace(valid=torch.zeros(1, 1, 32, 48))
    for answer in (seen.first(tiny), *seen.second(tiny)):
        assert all(torch.isfinite(value).all() for value in (*numbers(answer), answer.flow))
        assert answer.ego.abs().max() < 1e-6  # no weight anywhere: no motion
    assert seen.second(tiny)[-1].residual.abs().max() < 1e-6


def test_samples_of_a_batch_know_nothing_of_each_other(tiny, look):
    one, other = look((64, 64)), look((64, 64))
    together = type(one)(*(torch.cat(pair) for pair in zip(one, other, strict=True)))
    for theirs, ours in (
        (other.first(tiny), together.first(tiny)),
        (other.second(tiny)[-1], together.second(tiny)[-1]),
    ):
        for alone, joined in zip(numbers(theirs), numbers(ours), strict=True):
            torch.testing.assert_close(joined[1:], alone, atol=1e-4, rtol=1e-3)


def test_a_known_rotation_is_answered(tiny, look):
    """What a gyroscope says, rad per slice, comes back in rad/s, through both passes."""
    known = torch.tensor([[0.01, -0.02, 0.03, 1]])
    seen = look((64, 96))._replace(rotation=known)
    torch.testing.assert_close(seen.first(tiny).ego[:, 3:], known[:, :3], atol=1e-3, rtol=0)
    torch.testing.assert_close(seen.second(tiny)[-1].ego[:, 3:], known[:, :3] * 40, atol=0.04, rtol=0)


def test_the_flow_seen_contains_the_one_that_was_taken_out(tiny, look):
    """An untrained head says little: what is seen is about what was taken out, and exactly so with no head at all."""
    seen = look((64, 96))._replace(rotation=torch.tensor([[0.05, 0, 0, 1.0]]))
    with torch.random.fork_rng():
        silent = MotionNet(PRESETS["tiny"]).eval()
        silent.load_state_dict(tiny.state_dict())
    with torch.no_grad():
        for head in silent.second_pass.network.heads:
            head.weight.zero_()
        finest = seen.second(silent)[-1]
        first = seen.first(silent)
    torch.testing.assert_close(finest.seen, finest.taken)
    expected = (
        compensation(first.ego, first.rel_depth, first.flow, seen.intrinsics).rigid.mean((2, 3))
        / seen.intrinsics[:, :2]
        * 40
    )
    torch.testing.assert_close(finest.taken.mean((2, 3)), expected, rtol=0.02, atol=1e-3)
    assert finest.taken.abs().mean() > 0.1


@pytest.fixture
def soft(rng):
    """A prediction with soft shares of three objects, all of which move; float64."""
    mixture = torch.rand(1, 4, 4, 6, generator=rng).double().softmax(1)
    ego = torch.tensor([[0.3, -0.2, 0.5, 0.1, -0.2, 0.3]]).double()
    residual = torch.randn(1, 3, 3, generator=rng).double()
    depth = 0.5 + torch.rand(1, 1, 4, 6, generator=rng).double()
    flow, valid = torch.zeros(1, 2, 4, 6).double(), torch.ones(1, 1, 4, 6).double()
    intrinsics = torch.tensor([[5.0, 5, 2.5, 1.5]]).double()
    return Prediction(depth, ego, residual, mixture, flow, flow, valid, intrinsics, valid)


def test_flow_is_that_of_points_with_the_objects_velocity_before_a_moving_camera(soft):
    """However soft the mask: what each pixel is said to show moves as it is said to flow."""
    z = soft.rel_depth[0, 0]
    x, y = normalised_grid(soft.intrinsics, soft.rel_depth)[0]
    points, velocity = torch.stack((x * z, y * z, z), dim=-1), soft.object_velocity[0].movedim(0, -1)

    def seen_after(dt_s):
        moved = torch.cat((points + velocity * dt_s, torch.ones_like(points[..., :1])), dim=-1)
        at = moved @ torch.linalg.inv(se3_exp(soft.ego[0] * dt_s)).mT
        return (at[..., :2] / at[..., 2:3]).movedim(-1, 0)

    expected = (seen_after(1e-5) - seen_after(-1e-5)) / 2e-5
    torch.testing.assert_close(soft.flow[0], expected, atol=1e-8, rtol=1e-7)
    assert velocity.norm(dim=-1).min() > 0.05


def test_convention_residual_is_minus_the_objects_velocity(soft):
    mixture = torch.zeros_like(soft.mixture)
    mixture[:, 0, :, :3] = mixture[:, 2, :, 3:] = 1
    hard = soft._replace(mixture=mixture)
    expected = -soft.residual[0, 1].view(3, 1, 1).expand(3, 4, 3)
    torch.testing.assert_close(hard.object_velocity[0, :, :, 3:], expected)
    assert not hard.object_velocity[..., :3].any()


def test_what_moves_with_the_camera_stands_still_in_the_image(soft):
    residual = -soft.ego[:, None, :3].expand(1, 3, 3)
    mixture = torch.cat((torch.zeros(1, 1, 4, 6).double(), soft.mixture[:, 1:] / soft.mixture[:, 1:].sum(1)), dim=1)
    still = soft._replace(residual=residual, mixture=mixture, ego=soft.ego * torch.tensor([1, 1, 1, 0, 0, 0]))
    assert still.flow.abs().max() < 1e-9
    assert soft.flow.abs().max() > 0.1


def test_features_may_be_computed_in_half_the_precision(look):
    with torch.random.fork_rng():
        torch.manual_seed(0)
        model = MotionNet(PRESETS["tiny"]).eval()
    seen = look((64, 64))
    with torch.no_grad():
        exact = seen.second(model)[-1]
        rough = seen.second(compute_in(model, torch.bfloat16))[-1]
    assert rough.mixture.dtype == rough.ego.dtype == torch.float32
    assert 0 < (rough.mixture - exact.mixture).abs().max() < 0.05


def test_mean_one_of_nothing_is_finite():
    assert torch.isfinite(mean_one(torch.ones(1, 1, 2, 2), torch.zeros(1, 1, 2, 2))).all()
