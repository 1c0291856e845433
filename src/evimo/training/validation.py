"""How good a model is on fixed recordings while it trains: both passes as a run makes them, a few numbers.

The full scores are those of `evimo evaluate`; these choose weights and draw learning curves.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from evimo.events.direct_alignment import aligned
from evimo.events.local_motion import motion_candidates
from evimo.events.stack import CELL, SLICES, StaticMotion, plane_fits, voxel_grid
from evimo.geometry.rectification import halved_mask
from evimo.losses.depth import mean_over
from evimo.model.first_pass import FirstAnswer
from evimo.model.motion_net import SLICES_PER_S, MotionNet, Prediction
from evimo.model.second_pass import Compensation
from evimo.recordings.prepared import Prepared
from evimo.training.batches import Batch
from evimo.training.data import DEPTH_STEP, HALF, stack_of, true_motion, whole_batch
from evimo.training.objective import mask_known, taken_out

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

    def scores(self) -> dict[str, float]:
        """IoU per frame with a mover, pooled event IoU, share of events called moving where nothing does, and the
        errors of flow, of the static flow that was taken out, of rotation and of translation as shares of zero's.
        """
        pairs = {
            "iou": (self.iou, self.frames),
            "event_iou": (self.both, self.either),
            "alarms": (self.alarms, self.still_events),
            "flow": (self.flow, self.flow_zero),
            "static_flow": (self.rigid, self.flow_zero),
            "rotation": (self.rotation, self.rotation_zero),
            "translation": (self.translation, self.translation_zero),
        }
        return {name: top / bottom if bottom else float("nan") for name, (top, bottom) in pairs.items()}


@torch.no_grad()
def validated(
    model: MotionNet, recordings: Sequence[Prepared], *, every: int = 5, gyroscope: bool = False, oracle: bool = False
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
        wanted = sorted({k + d for k in middles for d in range(-HALF, HALF + 1)})
        firsts = {k: _first(model, recording, k, gyroscope=gyroscope) for k in wanted}
        for k in middles:
            batch, taken, answer = _answered(model, recording, k, firsts, gyroscope=gyroscope, oracle=oracle)
            _add_masks(sums, answer, batch)
            _add_motion(sums, answer, batch, taken.rigid)
    return sums.scores()


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
def slice_answered(model: MotionNet, recording: Prepared, k: int) -> tuple[Batch, Prediction]:
    """What both passes say of one slice, two slices from either end at least, beside the truth."""
    firsts = {k + d: _first(model, recording, k + d, gyroscope=False) for d in range(-HALF, HALF + 1)}
    batch, _, answer = _answered(model, recording, k, firsts, gyroscope=False, oracle=False)
    return batch, answer


def _answered(
    model: MotionNet,
    recording: Prepared,
    k: int,
    firsts: dict[int, FirstAnswer],
    *,
    gyroscope: bool,
    oracle: bool,
) -> tuple[Batch, Compensation, Prediction]:
    """The slice as the second pass sees it, what was taken out, and the answer."""
    first = firsts[k]
    twist = torch.cat([firsts[k + d].ego for d in range(-HALF, HALF + 1)]).numpy()
    own = StaticMotion(twist, (1 / first.rel_depth)[0, 0].numpy(), DEPTH_STEP, np.asarray(recording.intrinsics))
    motion = true_motion(recording, k) if oracle else aligned(stack_of(recording, k), own, known_rotation=gyroscope)
    batch = whole_batch(recording, [k], [motion], model.config.stride)
    taken = taken_out(batch, first)
    answer = model.second(
        batch.sharp_voxels, batch.sharp_fits, batch.valid, taken, batch.intrinsics, _rotation(recording, k, gyroscope)
    )[-1]
    return batch, taken, answer


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


def _add_motion(sums: Sums, answer: Prediction, batch: Batch, rigid: Tensor) -> None:
    at = (middle_events(batch) > 0) & batch.depth_valid
    focal_px = batch.intrinsics[:, :2, None, None] / SLICES_PER_S
    truth = batch.flow * focal_px
    if at.any():
        count = at.sum()
        sums.flow += float(((answer.seen * focal_px - truth).norm(dim=1, keepdim=True) * at).sum() / count)
        static = torch.nn.functional.interpolate(rigid, scale_factor=2.0, mode="bilinear")
        still = at & ~batch.moving
        sums.rigid += float(((static - truth).norm(dim=1, keepdim=True) * still).sum() / still.sum().clamp(min=1))
        sums.flow_zero += float((truth.norm(dim=1, keepdim=True) * at).sum() / count)
    scale = mean_over(batch.depth, batch.depth_valid).flatten()[:, None]
    sums.rotation += float((answer.ego[:, 3:] - batch.ego[:, 3:]).norm())
    sums.rotation_zero += float(batch.ego[:, 3:].norm())
    sums.translation += float((answer.ego[:, :3] * scale - batch.ego[:, :3]).norm())
    sums.translation_zero += float(batch.ego[:, :3].norm())
