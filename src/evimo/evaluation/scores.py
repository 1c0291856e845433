"""What one prediction of one slice scores, as ratios of sums that add up over slices, recordings and machines."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evimo.evaluation import metrics
from evimo.evaluation.labels import LabelledSlice
from evimo.evaluation.metrics import Floats, Mask
from evimo.recordings.estimate import Estimate

SMALL_AREA_PX = 30
DIRECTION_FROM_M_S = 0.05


@dataclass(frozen=True, slots=True)
class Score:
    """A ratio of two sums and how many samples are in it: frames for a mean over frames, slices for a pooled share."""

    top: float
    bottom: float
    samples: int = 1

    def __add__(self, other: "Score") -> "Score":
        return Score(self.top + other.top, self.bottom + other.bottom, self.samples + other.samples)

    @property
    def value(self) -> float | None:
        """The ratio; None where nothing was scored."""
        return self.top / self.bottom if self.bottom else None


Scores = dict[str, Score]


def added(parts: Iterable[Scores]) -> Scores:
    """Scores of several slices or recordings as one; a name that is missing in one part adds nothing."""
    total: Scores = {}
    for part in parts:
        for name, score in part.items():
            total[name] = total[name] + score if name in total else score
    return total


def share(chosen: Mask, among: Mask) -> Score:
    """Share of the pixels `among` that are `chosen`, pooled."""
    return Score(int(np.count_nonzero(chosen & among)), int(np.count_nonzero(among)))


def mask_scores(predicted: Mask, sample: LabelledSlice) -> Scores:
    """Overlap, recall and false alarms of a motion mask (H, W); only `scored` pixels and their events count."""
    called, true = predicted & sample.scored, sample.moving & sample.scored
    rows, columns = sample.events.y, sample.events.x
    called_events, true_events = called[rows, columns], true[rows, columns]
    cut, union = metrics.overlap(called, true)
    event_cut, event_union = metrics.overlap(called_events, true_events)
    area = int(np.count_nonzero(true))
    still = sample.active & ~true & ~sample.resting
    scores = {
        "iou_pooled": Score(cut, union),
        "event_iou": Score(event_cut, event_union),
        "recall": share(called, true & sample.active),
        "recall_dense": share(called, true),
        "clutter": share(called, still & sample.truth.clutter),
        "resting": share(called, sample.active & sample.resting),
        "background": share(called, still & ~sample.truth.clutter),
    }
    if area > 0:
        scores["iou"] = Score(cut / union, 1)
    if area >= SMALL_AREA_PX:
        scores["iou_30px"] = Score(cut / union, 1)
    if true_events.any():
        scores["event_iou_frames"] = Score(event_cut / event_union, 1)
    if not sample.moving.any():
        scores["false_alarm_events"] = Score(int(np.count_nonzero(called_events)), len(called_events))
        scores["false_alarm_pixels"] = share(called, sample.scored)
    return scores


def depth_scores(rel_depth: Floats, sample: LabelledSlice) -> Scores:
    """The six depth metrics of a relative depth map (H, W), median scale per frame; dense and at events."""
    known = sample.scored & sample.truth.valid & (sample.truth.depth > 0)
    scores: Scores = {}
    for suffix, pixels in (("", known), ("_events", known & sample.active)):
        if pixels.any():
            errors = metrics.depth_errors(rel_depth, sample.truth.depth, pixels, scale="median")
            scores |= {name + suffix: Score(error, 1) for name, error in errors._asdict().items()}
    return scores


def depth_scale(rel_depth: Floats, sample: LabelledSlice) -> float | None:
    """Metres per unit of relative depth, from the frame's medians (scale = depth-median); None without known depth."""
    known = sample.scored & sample.truth.valid & (sample.truth.depth > 0)
    return metrics.median_scale(rel_depth[known], sample.truth.depth[known]) if known.any() else None


def flow_scores(flow: Floats, sample: LabelledSlice) -> Scores:
    """Endpoint error in px/s of image velocity (2, H, W): mean over pixels, then slices; dense and at event pixels.

    `flow_ratio` is the summed error at event pixels over the error of zero flow: below 1 the model sees motion.
    """
    if sample.flow is None:
        return {}
    error = metrics.flow_error(flow, sample.flow, sample.focal_px)
    length = metrics.flow_error(np.zeros_like(sample.flow), sample.flow, sample.focal_px)
    known = sample.scored & sample.truth.valid & np.isfinite(length)
    scores: Scores = {}
    if known.any():
        scores["flow_dense"] = Score(float(error[known].mean()), 1)
    if (known & sample.active).any():
        at_events = known & sample.active
        scores["flow"] = Score(float(error[at_events].mean()), 1)
        scores["flow_ratio"] = Score(float(error[at_events].mean()), float(length[at_events].mean()))
    if (at_movers := known & sample.active & sample.moving).any():
        scores["flow_movers"] = Score(float(error[at_movers].mean()), 1)
    return scores


def twist_scores(ego: Floats, sample: LabelledSlice, *, metres: float | None) -> Scores:
    """Camera velocity and rotation errors of a twist (6,) in mean depths/s and rad/s; `metres` per mean depth.

    `aee_ratio` and `rre_ratio` are the summed errors over those of a zero twist: below 1 the model sees motion.
    """
    true_velocity, true_rotation = sample.truth.ego[:3], sample.truth.ego[3:]
    velocity, rotation = ego[:3], ego[3:]
    aee = float(metrics.endpoint_error(metrics.scaled_to(velocity, true_velocity), true_velocity))
    rre = float(metrics.rotation_error(rotation, true_rotation, dt_s=sample.dt_s))
    speed, turning = float(np.linalg.norm(true_velocity)), float(np.linalg.norm(true_rotation))
    scores = {
        "camera_aee": Score(aee, 1),
        "camera_rre": Score(rre, 1),
        "aee_ratio": Score(aee, speed),
        "rre_ratio": Score(rre, turning),
    }
    if metres is not None:
        scores["camera_aee_depth"] = Score(float(metrics.endpoint_error(velocity * metres, true_velocity)), 1)
    if speed > DIRECTION_FROM_M_S:
        scores["direction"] = Score(float(metrics.direction_error(velocity, true_velocity)), 1)
    return scores


def velocity_map(estimate: Estimate) -> NDArray[np.float64]:
    """(H, W, 3) predicted object velocity of each pixel in mean depths/s, camera axes; 0 on the background."""
    of_id = np.zeros((256, 3))
    for body in estimate.objects:
        of_id[body.id] = body.rel_velocity
    return of_id[estimate.ids]


def object_scores(velocity: Floats, sample: LabelledSlice, *, metres: float | None) -> Scores:
    """Velocity errors of the moving objects with at least 30 scored pixels, prediction averaged inside the true mask.

    velocity: (H, W, 3), mean depths/s, relative to the static world. An object of which nothing is predicted has
    velocity zero, which no scale can repair: its error is its true speed. `objects_found` is the share of the others.
    """
    parts: list[Scores] = []
    for key, body in sample.truth.objects.items():
        inside = sample.scored & (sample.truth.ids == key)
        if not body.moves or np.count_nonzero(inside) < SMALL_AREA_PX:
            continue
        mean = velocity[inside].mean(axis=0)
        aee = float(metrics.endpoint_error(metrics.scaled_to(mean, body.velocity), body.velocity))
        scores = {"object_aee": Score(aee, 1), "objects_found": Score(float(mean.any()), 1)}
        if metres is not None:
            scores["object_aee_depth"] = Score(float(metrics.endpoint_error(mean * metres, body.velocity)), 1)
        parts.append(scores)
    return added(parts)


def estimate_scores(estimate: Estimate, sample: LabelledSlice) -> Scores:
    """All scores of the model's answer for one slice."""
    metres = depth_scale(estimate.rel_depth, sample)
    return (
        mask_scores(estimate.moving, sample)
        | depth_scores(estimate.rel_depth, sample)
        | flow_scores(estimate.flow, sample)
        | twist_scores(estimate.ego, sample, metres=metres)
        | object_scores(velocity_map(estimate), sample, metres=metres)
    )
