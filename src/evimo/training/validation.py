"""How good a model is on fixed recordings while it trains: both passes as a run makes them, a few numbers.

The full scores are those of `evimo evaluate`; these choose weights and draw learning curves.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from evimo.evaluation.metrics import depth_errors
from evimo.events.direct_alignment import aligned
from evimo.events.local_motion import motion_candidates
from evimo.events.stack import CELL, SLICES, StaticMotion, plane_fits, voxel_grid
from evimo.geometry.rectification import halved_mask
from evimo.model.ecn import Ecn
from evimo.model.first_pass import FirstAnswer
from evimo.model.motion_net import SLICES_PER_S, MotionNet, Prediction
from evimo.model.networks import Model
from evimo.recordings.prepared import Prepared
from evimo.training.batches import Batch
from evimo.training.data import DEPTH_STEP, HALF, stack_of, true_motion, whole_batch
from evimo.training.objective import as_prediction, looked_again, mask_known, unit_m

FIRST_AND_LAST = HALF  # slices at either end that are not scored: their stacks are not whole


@dataclass
class Sums:
    """Sums that scores are ratios of."""

    iou: float = 0.0
    frames: int = 0
    both: float = 0.0
    either: float = 0.0
    alarms: float = 0.0
    still_events: float = 0.0
    flow: float = 0.0
    flow_zero: float = 0.0
    rigid: float = 0.0
    rotation: float = 0.0
    rotation_zero: float = 0.0
    translation: float = 0.0
    translation_zero: float = 0.0
    depth: float = 0.0
    depths: int = 0

    def scores(self) -> dict[str, float]:
        """IoU per frame with a mover, pooled event IoU, share of events called moving where nothing does, and the
        errors of flow, of the static flow that was taken out, of rotation and of translation as shares of zero's; and
        AbsRel of the depth, median scale. What a network does not say is no number.
        """
        pairs = {
            "iou": (self.iou, self.frames),
            "event_iou": (self.both, self.either),
            "alarms": (self.alarms, self.still_events),
            "flow": (self.flow, self.flow_zero),
            "static_flow": (self.rigid, self.flow_zero),
            "rotation": (self.rotation, self.rotation_zero),
            "translation": (self.translation, self.translation_zero),
            "depth": (self.depth, self.depths),
        }
        return {name: top / bottom if bottom else float("nan") for name, (top, bottom) in pairs.items()}


@torch.no_grad()
def validated(
    model: Model, recordings: Sequence[Prepared], *, every: int = 5, gyroscope: bool = False, oracle: bool = False
) -> dict[str, float]:
    """Return the scores of a model on recordings, of one slice in `every`; see `Sums.scores`.

    Slice by slice: without the agreement of neighbours that a run adds to the masks (docs/decisions/0008).

    gyroscope: whether it knows the true rotation. oracle: whether events are compensated by the truth.
    """
    sums = Sums()
    for recording in recordings:
        if not len(recording.event_t):
            continue
        whole = range(FIRST_AND_LAST, len(recording) - FIRST_AND_LAST, every)
        middles = sorted(set(whole) & set(recording.middles().tolist()))
        for batch, answer in _answers(model, recording, middles, gyroscope=gyroscope, oracle=oracle):
            if estimates_masks(model):
                _add_masks(sums, answer, batch)
            _add_motion(sums, answer, batch)
            _add_depth(sums, answer, batch)
    return sums.scores()


def estimates_masks(model: Model) -> bool:
    """Whether the network says what moves by itself."""
    return not isinstance(model, Ecn)


def _answers(
    model: Model, recording: Prepared, middles: Sequence[int], *, gyroscope: bool = False, oracle: bool = False
) -> Iterator[tuple[Batch, Prediction]]:
    """Each slice as the network sees it, whole, and the finest scale of its answer, at half the size."""
    if isinstance(model, Ecn):
        for k in middles:
            batch = whole_batch(recording, [k], [true_motion(recording, k)], model.config.stride)
            finest, _ = model.finest(batch.voxels, batch.valid, batch.intrinsics)
            said = as_prediction(finest, batch.intrinsics, step=CELL)
            yield batch, said._replace(taken=said.seen)  # all it sees is the static world's
        return
    wanted = sorted({k + d for k in middles for d in range(-HALF, HALF + 1)})
    firsts = {k: _first(model, recording, k, gyroscope=gyroscope) for k in wanted}
    for k in middles:
        yield _answered(model, recording, k, firsts, gyroscope=gyroscope, oracle=oracle)


def _rotation(recording: Prepared, k: int, gyroscope: bool) -> Tensor:
    known = torch.tensor(np.append(recording.ego[k, 3:] / SLICES_PER_S, 1).astype(np.float32))[None]
    return known if gyroscope else known * 0


def _first(model: MotionNet, recording: Prepared, k: int, *, gyroscope: bool) -> FirstAnswer:
    stride = model.config.stride
    height, width = (-(-side // stride) * stride // CELL for side in recording.valid.shape)
    stack = stack_of(recording, k)
    valid = halved_mask(recording.valid, (height * CELL, width * CELL))
    voxels, fits = voxel_grid(stack, (height, width), step=CELL), plane_fits(stack, (height, width))
    arrays = voxels, fits, motion_candidates(voxels), valid[None], recording.intrinsics
    see, fit, guess, inside, lens = (torch.from_numpy(each)[None] for each in arrays)
    return model.first(see, fit, guess, inside, lens, _rotation(recording, k, gyroscope))


@torch.no_grad()
def slice_answered(model: Model, recording: Prepared, k: int) -> tuple[Batch, Prediction]:
    """What the network says of one slice, two slices from either end at least, beside the truth."""
    return next(_answers(model, recording, [k]))


def _answered(
    model: MotionNet,
    recording: Prepared,
    k: int,
    firsts: dict[int, FirstAnswer],
    *,
    gyroscope: bool,
    oracle: bool,
) -> tuple[Batch, Prediction]:
    """The slice as the second pass sees it, and the answer."""
    first = firsts[k]
    twist = torch.cat([firsts[k + d].ego for d in range(-HALF, HALF + 1)]).numpy()
    own = StaticMotion(twist, (1 / first.rel_depth)[0, 0].numpy(), DEPTH_STEP, np.asarray(recording.intrinsics))
    motion = true_motion(recording, k) if oracle else aligned(stack_of(recording, k), own, known_rotation=gyroscope)
    batch = whole_batch(recording, [k], [motion], model.config.stride)
    batch = batch._replace(rotation=_rotation(recording, k, gyroscope))
    return batch, looked_again(model, batch, first)[-1]


def middle_events(batch: Batch) -> Tensor:
    """How many events of the middle slice each pixel has, (B, 1, h, w), at half the size."""
    per_slice = batch.voxels.shape[1] // SLICES
    return batch.voxels[:, HALF * per_slice : (HALF + 1) * per_slice].expm1().sum(1, keepdim=True) * (batch.valid > 0)


def _add_masks(sums: Sums, answer: Prediction, batch: Batch) -> None:
    known = mask_known(batch)
    called, moving, events = (answer.mixture[:, :1] < 0.5) & known, batch.moving & known, middle_events(batch) * known
    if moving.any():
        sums.iou += float((called & moving).sum() / (called | moving).sum())
        sums.frames += 1
    else:
        sums.alarms += float((events * called).sum())
        sums.still_events += float(events.sum())
    sums.both += float((events * (called & moving)).sum())
    sums.either += float((events * (called | moving)).sum())


def _add_motion(sums: Sums, answer: Prediction, batch: Batch) -> None:
    at = (middle_events(batch) > 0) & batch.depth_valid
    focal_px = batch.intrinsics[:, :2, None, None] / SLICES_PER_S
    truth = batch.flow * focal_px
    if at.any():
        count = at.sum()
        sums.flow += float(((answer.seen * focal_px - truth).norm(dim=1, keepdim=True) * at).sum() / count)
        still = at & ~batch.moving
        static = ((answer.taken * focal_px - truth).norm(dim=1, keepdim=True) * still).sum()
        sums.rigid += float(static / still.sum().clamp(min=1))
        sums.flow_zero += float((truth.norm(dim=1, keepdim=True) * at).sum() / count)
    sums.rotation += float((answer.ego[:, 3:] - batch.ego[:, 3:]).norm())
    sums.rotation_zero += float(batch.ego[:, 3:].norm())
    if (batch.depth_valid & (batch.valid > 0)).any():  # else nobody knows the unit of the translation
        sums.translation += float((answer.ego[:, :3] * unit_m(answer, batch).flatten() - batch.ego[:, :3]).norm())
        sums.translation_zero += float(batch.ego[:, :3].norm())


def _add_depth(sums: Sums, answer: Prediction, batch: Batch) -> None:
    known = ((batch.valid > 0) & batch.depth_valid)[0, 0].numpy()
    if known.any():
        errors = depth_errors(answer.rel_depth[0, 0].numpy(), batch.depth[0, 0].numpy(), known, scale="median")
        sums.depth += errors.abs_rel
        sums.depths += 1
