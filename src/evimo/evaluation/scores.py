"""What one prediction of one slice scores, as ratios of sums that add up over slices, recordings and machines."""

import numpy as np

from evimo.evaluation import metrics
from evimo.evaluation.labels import SMALL_AREA_PX, LabelledSlice
from evimo.evaluation.metrics import Floats, Mask
from evimo.evaluation.pixel_classes import ACTIVE, CLUTTER, MOVING, RESTING, PixelClasses
from evimo.evaluation.ratios import Score, Scores, added
from evimo.evaluation.strata import mover_scores
from evimo.recordings.prediction import Prediction

AT_REST_M_S = 0.05
"""A camera slower than this is at rest: the direction of its velocity says nothing, and any length of it is noise."""


def mask_scores(predicted: Mask, sample: LabelledSlice, classes: PixelClasses | None = None) -> Scores:
    """Overlap, recall and false alarms of a motion mask (H, W); only `scored` pixels and their events count.

    An event is called moving where the mask is at its pixel. `classes` are the sample's: who scores several masks of it
    makes them once.
    """
    classes = classes or PixelClasses(sample)
    called = predicted & sample.scored
    found, there = classes.count(called), classes.scored

    def share(what: int = 0, lacking: int = 0) -> Score:
        return Score(found.having(what, lacking=lacking), there.having(what, lacking=lacking))

    cut, area = found.having(MOVING), there.having(MOVING)
    union = area + found.having(lacking=MOVING)
    scores = {
        "iou_pooled": Score(cut, union),
        "recall": share(MOVING | ACTIVE),
        "recall_dense": share(MOVING),
        "clutter": share(ACTIVE | CLUTTER, lacking=MOVING | RESTING),
        "resting": share(ACTIVE | RESTING),
        "background": share(ACTIVE, lacking=MOVING | RESTING | CLUTTER),
    }
    if area > 0:
        scores["iou"] = Score(cut / union, 1)
    if area >= SMALL_AREA_PX:
        scores["iou_30px"] = Score(cut / union, 1)
    if not sample.moving.any():
        scores["false_alarm_pixels"] = share()
    scores |= mover_scores(called, sample, found)
    return scores | event_label_scores(called[sample.events.y, sample.events.x], sample, classes)


def event_label_scores(called: Mask, sample: LabelledSlice, classes: PixelClasses | None = None) -> Scores:
    """Overlap and false alarms of labels of the slice's events, from a mask or from whatever else labels events.

    `event_iou` asks what the mask at the slice's centre says of the event's pixel, `event_iou_own` which object the
    event itself comes from: at 8 px a slice, these are not the same events.

    Args:
        called: (N,), which of `sample.events` are called moving; of labels of all the slice's events, those `kept`.
        sample: the slice.
        classes: of the sample, as for `mask_scores`.
    """
    classes = classes or PixelClasses(sample)
    cut, union = metrics.overlap(called, classes.true_events)
    scores = {"event_iou": Score(cut, union)}
    if classes.true_events.any():
        scores["event_iou_frames"] = Score(cut / union, 1)
    if classes.own_events is not None:
        scores["event_iou_own"] = Score(*metrics.overlap(called, classes.own_events))
    if not sample.moving.any():
        scores["false_alarm_events"] = Score(int(np.count_nonzero(called)), len(called))
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

    `flow_ratio` is the summed error at event pixels over the error of zero flow: below 1 the model sees motion;
    `flow_movers_ratio` the same at event pixels of movers.
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
        scores["flow_movers_ratio"] = Score(float(error[at_movers].mean()), float(length[at_movers].mean()))
    return scores


def at_rest(sample: LabelledSlice) -> bool:
    """Whether the camera is slower than 5 cm/s now; its translation is not scored then."""
    return float(np.linalg.norm(sample.truth.ego[:3])) < AT_REST_M_S


def twist_scores(ego: Floats, sample: LabelledSlice, *, metres: float | None) -> Scores:
    """Camera velocity and rotation errors of a twist (6,) in mean depths/s and rad/s; `metres` per mean depth.

    Errors of the velocity only where the camera is not at rest. A `…_ratio` is the summed error over that of a zero
    twist: below 1 the model sees motion.
    """
    true_velocity, true_rotation = sample.truth.ego[:3], sample.truth.ego[3:]
    velocity, rotation = ego[:3], ego[3:]
    rre = float(metrics.rotation_error(rotation, true_rotation, dt_s=sample.dt_s))
    scores = {"camera_rre": Score(rre, 1), "rre_ratio": Score(rre, float(np.linalg.norm(true_rotation)))}
    if at_rest(sample):
        return scores
    speed = float(np.linalg.norm(true_velocity))
    aee = float(metrics.endpoint_error(metrics.scaled_to(velocity, true_velocity), true_velocity))
    scores |= {
        "camera_aee": Score(aee, 1),
        "aee_ratio": Score(aee, speed),
        "direction": Score(float(metrics.direction_error(velocity, true_velocity)), 1),
    }
    if metres is not None:
        by_depth = float(metrics.endpoint_error(velocity * metres, true_velocity))
        scores |= {"camera_aee_depth": Score(by_depth, 1), "aee_depth_ratio": Score(by_depth, speed)}
    return scores


def object_scores(velocity: Floats, sample: LabelledSlice, *, metres: float | None) -> Scores:
    """Velocity errors of the moving objects with at least 30 scored pixels, prediction averaged inside the true mask.

    velocity: (H, W, 3), mean depths/s, relative to the static world. An object of which nothing is predicted has
    velocity zero, which no scale can repair: its error is its true speed. `objects_found` is the share of the others,
    and `object_aee_found` the mean over those alone.
    """
    parts: list[Scores] = []
    for key, body in sample.truth.objects.items():
        inside = sample.scored & (sample.truth.ids == key)
        if not body.moves or np.count_nonzero(inside) < SMALL_AREA_PX:
            continue
        mean = velocity[inside].mean(axis=0)
        aee = float(metrics.endpoint_error(metrics.scaled_to(mean, body.velocity), body.velocity))
        scores = {"object_aee": Score(aee, 1), "objects_found": Score(float(mean.any()), 1)}
        if mean.any():
            scores["object_aee_found"] = Score(aee, 1)
        if metres is not None:
            scores["object_aee_depth"] = Score(float(metrics.endpoint_error(mean * metres, body.velocity)), 1)
        parts.append(scores)
    return added(parts)


def prediction_scores(prediction: Prediction, sample: LabelledSlice) -> Scores:
    """All scores of what a program says of one slice, of as much as it says.

    Its mask labels the events, too: what it says of events themselves is scored by `event_label_scores`.
    """
    rel_depth, ego, velocity = prediction.rel_depth, prediction.ego, prediction.velocity
    metres = None if rel_depth is None else depth_scale(rel_depth, sample)
    scores: Scores = {}
    if prediction.moving is not None:
        scores |= mask_scores(prediction.moving, sample)
    if rel_depth is not None:
        scores |= depth_scores(rel_depth, sample)
    if prediction.flow is not None:
        scores |= flow_scores(prediction.flow, sample)
    if ego is not None:
        scores |= twist_scores(ego, sample, metres=metres)
    if velocity is not None:
        scores |= object_scores(velocity, sample, metres=metres)
    return scores
