"""Terms of the objective at one scale, from prediction and batch; joined over scales by pixels."""

from collections.abc import Callable
from math import pi

import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d, max_pool2d, pad

from evimo.errors import BadInput
from evimo.geometry.warping import resized_points
from evimo.losses.depth import depth_loss, mean_over
from evimo.losses.mask import balance, dice_loss, mask_loss, one_sided_mask_loss
from evimo.losses.motion import flow_loss, object_velocity_loss, twist_loss
from evimo.losses.smoothness import depth_smoothness, mixture_smoothness
from evimo.losses.total import total, weighted_total
from evimo.losses.warp import coarse_warp_loss, fine_warp_loss
from evimo.model.motion_net import SLICES_PER_S, MotionNet, Prediction
from evimo.training.batches import Batch
from evimo.training.recipes import Recipe


def at_scale(batch: Batch, prediction: Prediction, stride: int) -> Batch:
    """The batch at the size of a prediction: one pixel in s x s for the truth, area averages for the frames."""
    right, down = -batch.frames.shape[-1] % stride, -batch.frames.shape[-2] % stride
    step = (batch.frames.shape[-1] + right) // prediction.rel_depth.shape[-1]

    def picked(image: Tensor) -> Tensor:
        return pad(image, (0, right, 0, down))[..., step // 2 :: step, step // 2 :: step]

    frames = avg_pool2d(pad(batch.frames, (0, right, 0, down)).flatten(1, 2), step).unflatten(
        1, batch.frames.shape[1:3]
    )
    size = (batch.frames.shape[-2] + down, batch.frames.shape[-1] + right)
    new_size = (prediction.rel_depth.shape[-2], prediction.rel_depth.shape[-1])
    events = None if batch.events is None else resized_points(batch.events, size, new_size)
    return batch._replace(
        events=events,
        frames=frames,
        valid=(picked(batch.valid) > 0).to(batch.valid),
        intrinsics=prediction.intrinsics,
        depth=picked(batch.depth),
        depth_valid=picked(batch.depth_valid),
        moving=picked(batch.moving),
        flow=picked(batch.flow),
        velocity=picked(batch.velocity),
    )


def directions(velocity: Tensor, count: int) -> Tensor:
    """Soft share of each of `count` directions in the image plane, (B, C, H, W): which mixture channel is whose.

    The channels are interchangeable by nature; tying each to a sector of directions keeps them apart.
    """
    angle = torch.atan2(velocity[:, 1], velocity[:, 0])
    centres = torch.arange(count, device=angle.device) * (2 * pi / count)
    share = (torch.cos(angle[:, None] - centres.view(1, -1, 1, 1)) + 0.5).clamp(min=0)
    return share / share.sum(1, keepdim=True)


def terms(prediction: Prediction, batch: Batch, mean_depth: Tensor, recipe: Recipe) -> dict[str, Tensor]:
    """Per-pixel losses of one scale, (B, 1, h, w) each, of the terms the recipe names.

    Args:
        prediction: of this scale.
        batch: brought to this scale by `at_scale`.
        mean_depth: of the truth, (B, 1, 1, 1), m.
        recipe: which terms.
    """
    named: dict[str, Callable[[], Tensor]] = {
        "seen": lambda: _seen(prediction, batch),
        "flow": lambda: _flow_error(prediction.flow, prediction, batch),
        "twist": lambda: _twist(prediction, batch, mean_depth.flatten()),
        "velocity": lambda: _velocity(prediction, batch, mean_depth),
        "direction": lambda: _direction(prediction, batch),
        "mask_one_sided": lambda: one_sided_mask_loss(prediction.mixture[:, :1], batch.moving, batch.valid > 0),
        "mask": lambda: _mask(prediction, batch, recipe.moving_share),
        "dice": lambda: _spread(dice_loss(prediction.mixture[:, :1], batch.moving, batch.valid > 0), prediction),
        "mask_smoothness": lambda: mixture_smoothness(prediction.mixture),
        "depth": lambda: depth_loss(prediction.rel_depth, batch.depth / mean_depth, _known(batch)),
        "depth_smoothness": lambda: depth_smoothness(prediction.rel_depth),
        "coarse_warp": lambda: _coarse_warp(prediction, batch),
        "fine_warp": lambda: _fine_warp(prediction, batch),
    }
    return {name: named[name]() for name, weight in recipe.weights.items() if weight}


def objective(
    model: MotionNet, batch: Batch, recipe: Recipe, *, with_masks: bool = True
) -> tuple[Tensor, dict[str, float]]:
    """The total loss of a batch over all scales, and the mean of each term.

    `with_masks` is False while motion is trained first.
    """
    mean_depth = mean_over(batch.depth, batch.depth_valid)
    per_scale = [
        terms(prediction, at_scale(batch, prediction, model.config.stride), mean_depth, recipe)
        for prediction in model(batch.frames, batch.valid, batch.intrinsics)
    ]
    joined = {name: weighted_total([scale[name] for scale in per_scale]) for name in per_scale[0]}
    waiting = set[str]() if with_masks else {"mask", "dice"}
    weights = {name: 0.0 if name in waiting else recipe.weights[name] for name in joined}
    return total(joined, weights), {name: float(value.detach()) for name, value in joined.items()}


def _known(batch: Batch) -> Tensor:
    return (batch.valid > 0) & batch.depth_valid


def _flow_error(flow: Tensor, prediction: Prediction, batch: Batch) -> Tensor:
    """Compressed error in px of this scale per slice."""
    to_px = prediction.intrinsics[:, :2, None, None] / SLICES_PER_S
    return flow_loss(flow * to_px, batch.flow * to_px, _known(batch), knee=3.0)


def _seen(prediction: Prediction, batch: Batch) -> Tensor:
    """The seen flow counts most where events are: elsewhere it can only be guessed."""
    middle = batch.frames[:, batch.frames.shape[1] // 2, :2].sum(1, keepdim=True)
    near_events = max_pool2d(middle, 3, 1, 1) > 0
    return _flow_error(prediction.seen, prediction, batch) * (0.3 + near_events)


def _spread(per_sample: Tensor, prediction: Prediction) -> Tensor:
    """A loss per sample on every pixel of the scale, so that scales are weighted by pixels."""
    return per_sample.view(-1, 1, 1, 1).expand_as(prediction.rel_depth)


def _twist(prediction: Prediction, batch: Batch, mean_depth: Tensor) -> Tensor:
    """Error of the egomotion against 1 + its size: fast scenes are not all that counts."""
    size = batch.ego[:, 3:].norm(dim=1) + batch.ego[:, :3].norm(dim=1) / mean_depth
    return _spread(twist_loss(prediction.ego, batch.ego, mean_depth=mean_depth) / (1 + size), prediction)


def _over_movers(values: Tensor, batch: Batch) -> Tensor:
    """Values inside movers, each sample's mean counting alike, whatever the size of its movers."""
    inside = batch.moving & _known(batch)
    pixels = inside[0].numel() / inside.sum((1, 2, 3), keepdim=True).clamp(min=10)
    return torch.where(inside, values * pixels, 0)


def _velocity(prediction: Prediction, batch: Batch, mean_depth: Tensor) -> Tensor:
    truth = batch.velocity / mean_depth
    error = object_velocity_loss(prediction.object_velocity, truth, batch.moving & _known(batch))
    return _over_movers(error / (1 + truth.norm(dim=1, keepdim=True)), batch)


def _direction(prediction: Prediction, batch: Batch) -> Tensor:
    share = prediction.mixture[:, 1:] / (prediction.mixture[:, 1:].sum(1, keepdim=True) + 1e-6)
    target = directions(batch.velocity, share.shape[1])
    return _over_movers(-(target * (share + 1e-4).log()).sum(1, keepdim=True), batch)


def _mask(prediction: Prediction, batch: Batch, moving_share: float) -> Tensor:
    inside = batch.valid > 0
    return mask_loss(prediction.mixture[:, :1], batch.moving, inside) * balance(
        batch.moving, inside, moving_share=moving_share
    )


def _px_per_s(prediction: Prediction) -> Tensor:
    return prediction.flow * prediction.intrinsics[:, :2, None, None]


def _coarse_warp(prediction: Prediction, batch: Batch) -> Tensor:
    slices = batch.frames.shape[1]
    elapsed_s = (torch.arange(slices, device=batch.frames.device) - slices // 2) / SLICES_PER_S
    return coarse_warp_loss(batch.frames, _px_per_s(prediction), batch.valid > 0, elapsed_s=elapsed_s)


def _fine_warp(prediction: Prediction, batch: Batch) -> Tensor:
    if batch.events is None:
        raise BadInput("a batch without events", fix="draw it with events=True")
    return fine_warp_loss(_px_per_s(prediction), batch.events).mean(1, keepdim=True)
