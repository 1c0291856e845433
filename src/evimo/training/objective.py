"""Terms of the objective, from predictions and batch; joined over scales by pixels."""

from collections.abc import Callable
from math import pi

import torch
from torch import Tensor
from torch.nn.functional import max_pool2d

from evimo.errors import BadInput
from evimo.events.stack import BINS, SLICES
from evimo.geometry.grids import resized_intrinsics
from evimo.geometry.warping import resized_points
from evimo.losses.depth import depth_loss, mean_over
from evimo.losses.mask import balance, dice_loss, mask_loss, one_sided_mask_loss
from evimo.losses.motion import flow_loss, object_velocity_loss, twist_loss
from evimo.losses.smoothness import depth_smoothness, mixture_smoothness
from evimo.losses.total import total, weighted_total
from evimo.losses.warp import coarse_warp_loss, fine_warp_loss
from evimo.model.backbone import reduced
from evimo.model.ecn import Ecn
from evimo.model.first_pass import FIRST_STEP, FirstAnswer
from evimo.model.motion_net import SLICES_PER_S, MotionNet, Prediction
from evimo.model.networks import Model
from evimo.model.second_pass import Compensation, compensation
from evimo.training.batches import Batch
from evimo.training.recipes import Recipe

_MIDDLE = slice(2 * BINS * (SLICES // 2), 2 * BINS * (SLICES // 2 + 1))
_MOVERS = 2.0  # what a flow error on movers counts more


def at_scale(batch: Batch, prediction: Prediction) -> Batch:
    """The batch at the size of a prediction: one pixel in s x s for the truth, area averages for the events."""
    step = batch.valid.shape[-1] // prediction.rel_depth.shape[-1]

    def picked(image: Tensor) -> Tensor:
        return image[..., step // 2 :: step, step // 2 :: step]

    size, new_size = batch.sharp_voxels.shape[-2:], prediction.rel_depth.shape[-2:]
    events = (
        None if batch.events is None else resized_points(batch.events, (size[0], size[1]), (new_size[0], new_size[1]))
    )
    return batch._replace(
        events=events,
        voxels=reduced(batch.voxels.expm1(), step) if step > 1 else batch.voxels.expm1(),
        valid=picked(batch.valid),
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
    if count == 1:
        return torch.ones_like(angle)[:, None]
    centres = torch.arange(count, device=angle.device) * (2 * pi / count)
    share = (torch.cos(angle[:, None] - centres.view(1, -1, 1, 1)) + 0.5).clamp(min=0)
    return share / share.sum(1, keepdim=True)


def unit_m(prediction: Prediction | FirstAnswer, batch: Batch) -> Tensor:
    """Metres that a relative depth of 1 means in an answer, (B, 1, 1, 1): the ratio of both means where depth is known.

    An answer's depths have a mean of 1 over all that the lens sees. Datasets know the depth of objects alone, which are
    nearer than the rest: their mean alone would be another unit.

    Args:
        prediction: of the batch's size.
        batch: brought to that size.
    """
    known = _known(batch)
    return mean_over(batch.depth, known) / mean_over(prediction.rel_depth.detach(), known)


def terms(prediction: Prediction, batch: Batch, unit: Tensor, recipe: Recipe) -> dict[str, Tensor]:
    """Per-pixel losses of one scale of the answer, (B, 1, h, w) each, of the terms the recipe names.

    Args:
        prediction: of this scale.
        batch: brought to this scale by `at_scale`.
        unit: of the answer's depths and translations, (B, 1, 1, 1), m, see `unit_m`.
        recipe: which terms.
    """
    named: dict[str, Callable[[], Tensor]] = {
        "seen": lambda: _flow_error(prediction.seen, prediction, batch, besides=prediction.taken),
        "flow": lambda: _flow_error(prediction.flow, prediction, batch, besides=prediction.taken),
        "twist": lambda: _twist(prediction, batch, unit.flatten()),
        "velocity": lambda: _velocity(prediction, batch, unit),
        "direction": lambda: _direction(prediction, batch),
        "mask_one_sided": lambda: one_sided_mask_loss(prediction.mixture[:, :1], batch.moving, mask_known(batch)),
        "mask": lambda: _mask(prediction, batch, recipe.moving_share),
        "dice": lambda: _spread(dice_loss(prediction.mixture[:, :1], batch.moving, mask_known(batch)), prediction),
        "mask_smoothness": lambda: mixture_smoothness(prediction.mixture),
        "depth": lambda: depth_loss(prediction.rel_depth, batch.depth / unit, _known(batch)),
        "depth_smoothness": lambda: depth_smoothness(prediction.rel_depth),
        "coarse_warp": lambda: _coarse_warp(prediction.flow, prediction, batch),
        "fine_warp": lambda: _fine_warp(prediction.flow, prediction, batch),
    }
    return {name: named[name]() for name, weight in recipe.weights.items() if weight}


def first_terms(answer: FirstAnswer, batch: Batch, recipe: Recipe) -> dict[str, Tensor]:
    """Per-pixel losses of the first pass, (B, 1, h, w) each, of the terms the recipe names; as `terms`."""
    prediction = as_prediction(answer, batch.intrinsics)
    here = at_scale(batch, prediction)
    still, unit = here._replace(depth_valid=here.depth_valid & ~here.moving), unit_m(answer, here)
    named: dict[str, Callable[[], Tensor]] = {
        "seen": lambda: _flow_error(prediction.seen, prediction, here),
        "rigid": lambda: _flow_error(prediction.flow, prediction, still),
        "twist": lambda: _twist(prediction, here, unit.flatten()),
        "depth": lambda: depth_loss(prediction.rel_depth, here.depth / unit, _known(here)),
        "coarse_warp": lambda: _coarse_warp(prediction.flow, prediction, here),
        "fine_warp": lambda: _fine_warp(prediction.flow, prediction, here),
    }
    return {name: named[name]() for name, weight in recipe.first.items() if weight}


def as_prediction(answer: FirstAnswer, intrinsics: Tensor, *, step: int = FIRST_STEP) -> Prediction:
    """What the first pass alone would answer: that nothing moves by itself.

    step: px of the rectified image per pixel of the answer.
    """
    still = torch.zeros_like(answer.rel_depth)
    per_second = SLICES_PER_S / intrinsics[:, :2, None, None]
    return Prediction(
        rel_depth=answer.rel_depth,
        ego=answer.ego * SLICES_PER_S,
        residual=answer.ego.new_zeros(len(answer.ego), 1, 3),
        mixture=torch.cat((still + 1, still), dim=1),
        seen=answer.flow * per_second,
        taken=answer.flow * 0,
        confidence=still + 1,
        intrinsics=resized_intrinsics(intrinsics, (step, step), (1, 1)),
        valid=answer.valid,
    )


def looked_once(model: Ecn, batch: Batch) -> list[Prediction]:
    """What the network that looks once says of a batch, from the coarsest to the finest scale."""
    answers, _ = model(batch.voxels, batch.valid, batch.intrinsics)
    steps = [FIRST_STEP * 2**k for k in reversed(range(len(answers)))]
    return [as_prediction(answer, batch.intrinsics, step=step) for answer, step in zip(answers, steps, strict=True)]


def objective(model: Model, batch: Batch, recipe: Recipe) -> tuple[Tensor, dict[str, Tensor]]:
    """The total loss of a batch over all passes and scales, and the mean of each term, detached.

    Every sample weighs the same and none depends on another: the loss of a batch is the mean of its samples' losses.
    Nothing here asks a GPU for a number, so that a CUDA graph can hold it.
    """
    of_first: dict[str, Tensor] = {}
    if isinstance(model, Ecn):
        answers = looked_once(model, batch)
    else:
        first = model.first(batch.voxels, batch.fits, batch.candidates, batch.valid, batch.intrinsics, batch.rotation)
        of_first = first_terms(first, batch, recipe)
        answers = looked_again(model, batch, first)
    here = [at_scale(batch, answer) for answer in answers]
    unit = unit_m(answers[-1], here[-1])
    per_scale = [terms(answer, there, unit, recipe) for answer, there in zip(answers, here, strict=True)]
    joined = {f"first_{name}": weighted_total([value]) for name, value in of_first.items()}
    joined |= {name: weighted_total([scale[name] for scale in per_scale]) for name in per_scale[0]}
    weights = {f"first_{name}": recipe.first[name] for name in of_first}
    weights |= {name: recipe.weights[name] for name in per_scale[0]}
    return total(joined, weights), {name: value.detach() for name, value in joined.items()}


def looked_again(model: MotionNet, batch: Batch, first: FirstAnswer) -> list[Prediction]:
    """What the second pass says of a batch, from the coarsest to the finest scale."""
    taken = taken_out(batch, first)
    return model.second(batch.sharp_voxels, batch.sharp_fits, batch.valid, taken, batch.intrinsics, batch.rotation)


def taken_out(batch: Batch, first: FirstAnswer) -> Compensation:
    """What was taken out of the batch's events, beside the flow that the first pass saw."""
    return compensation(batch.taken_ego, batch.taken_depth, first.flow.detach(), batch.intrinsics)


def _known(batch: Batch) -> Tensor:
    """Where depth and flow are known: not in a pixel at the border, of which the lens sees a part alone, and not in
    front of a background that a dataset has no depth of.
    """
    return (batch.valid > 0) & batch.depth_valid


def mask_known(batch: Batch) -> Tensor:
    """Where it is known whether something moves: where depth is known, and in every pixel that the lens sees whole, as
    datasets without a background's depth know that it rests.
    """
    return _known(batch) | (batch.valid >= 1)


def _flow_error(flow: Tensor, prediction: Prediction, batch: Batch, *, besides: Tensor | None = None) -> Tensor:
    """Compressed error in px of this scale per slice, of the flow besides the one that was taken out.

    It counts most where events are, elsewhere flow can only be guessed, and on what moves by itself.
    """
    to_px = prediction.intrinsics[:, :2, None, None] / SLICES_PER_S
    taken = 0 if besides is None else besides
    near_events = max_pool2d(batch.voxels[:, _MIDDLE].sum(1, keepdim=True), 3, 1, 1) > 0
    error = flow_loss((flow - taken) * to_px, (batch.flow - taken) * to_px, _known(batch), knee=3.0)
    return error * (0.2 + near_events) * (1 + _MOVERS * batch.moving)


def _spread(per_sample: Tensor, prediction: Prediction) -> Tensor:
    """A loss per sample on every pixel of the scale, so that scales are weighted by pixels."""
    return per_sample.view(-1, 1, 1, 1).expand_as(prediction.rel_depth)


def _twist(prediction: Prediction, batch: Batch, unit: Tensor) -> Tensor:
    """Error of the egomotion against 1 + its size: fast scenes are not all that counts.

    Where no depth is known, nobody knows the unit of the translation, and only rotations are compared.
    """
    known = _known(batch).flatten(1).any(1, keepdim=True)
    translation = torch.where(known, batch.ego[:, :3], (prediction.ego[:, :3] * unit[:, None]).detach())
    truth = torch.cat((translation, batch.ego[:, 3:]), dim=1)
    size = truth[:, 3:].norm(dim=1) + truth[:, :3].norm(dim=1) / unit
    return _spread(twist_loss(prediction.ego, truth, mean_depth=unit) / (1 + size), prediction)


def _over_movers(values: Tensor, batch: Batch) -> Tensor:
    """Values inside movers, each sample's mean counting alike, whatever the size of its movers."""
    inside = batch.moving & _known(batch)
    pixels = inside[0].numel() / inside.sum((1, 2, 3), keepdim=True).clamp(min=10)
    return torch.where(inside, values * pixels, 0)


def _velocity(prediction: Prediction, batch: Batch, unit: Tensor) -> Tensor:
    truth = batch.velocity / unit
    error = object_velocity_loss(prediction.object_velocity, truth, batch.moving & _known(batch))
    return _over_movers(error / (1 + truth.norm(dim=1, keepdim=True)), batch)


def _direction(prediction: Prediction, batch: Batch) -> Tensor:
    share = prediction.mixture[:, 1:] / (prediction.mixture[:, 1:].sum(1, keepdim=True) + 1e-6)
    target = directions(batch.velocity, share.shape[1])
    return _over_movers(-(target * (share + 1e-4).log()).sum(1, keepdim=True), batch)


def _mask(prediction: Prediction, batch: Batch, moving_share: float) -> Tensor:
    known = mask_known(batch)
    weight = balance(batch.moving, known, moving_share=moving_share)
    return mask_loss(prediction.mixture[:, :1], batch.moving, known) * weight


def _px_per_s(flow: Tensor, prediction: Prediction) -> Tensor:
    return flow * prediction.intrinsics[:, :2, None, None]


def slice_counts(counts: Tensor) -> Tensor:
    """Each slice's events of either polarity, (B, 5, 2, h, w), from counts (B, 30, h, w) by slice, bin and polarity."""
    return counts.unflatten(1, (SLICES, BINS, 2)).sum(2)


def _coarse_warp(flow: Tensor, prediction: Prediction, batch: Batch) -> Tensor:
    elapsed_s = (torch.arange(SLICES, device=flow.device) - SLICES // 2) / SLICES_PER_S
    counts, flow_px = slice_counts(batch.voxels), _px_per_s(flow, prediction)
    return coarse_warp_loss(counts, flow_px, batch.valid > 0, elapsed_s=elapsed_s)


def _fine_warp(flow: Tensor, prediction: Prediction, batch: Batch) -> Tensor:
    if batch.events is None:
        raise BadInput("a batch without events", fix="draw it with events=True")
    return fine_warp_loss(_px_per_s(flow, prediction), batch.events).mean(1, keepdim=True)
