"""What each number of a report is: its header, its unit, which way is better, what exactly is measured."""

from collections.abc import Mapping

from evimo.evaluation.baselines import CONSTANT_DEPTH
from evimo.evaluation.ceilings import NEAREST_M, THRESHOLD_PX
from evimo.evaluation.column import Column
from evimo.evaluation.protocols import DENSE, EVENTS, MOVERS, NEW, SLICE, Protocol
from evimo.evaluation.strata import AREAS, FAMILIARITY, RESIDUALS
from evimo.recordings.truth import MOVING_DEGPS, MOVING_MPS

OF_ALL: tuple[Column, ...] = (
    Column("iou", "IoU", "higher", "dense, mean over frames in which something moves in sight"),
    Column("iou_30px", "IoU ≥30px", "higher", "the same over frames with at least 30 moving pixels"),
    Column("iou_pooled", "pooled IoU", "higher", "dense, intersections over unions summed over all frames"),
    Column("event_iou", "event IoU", "higher", "events labelled by the mask at their pixel, summed over all frames"),
    Column("event_iou_frames", "event IoU, frames", "higher", "the same, mean over frames with a moving event"),
    Column(
        "event_iou_own", "event IoU, own", "higher", "event IoU against the object that each event says it comes from"
    ),
    Column("recall", "recall", "higher", "share of the movers' pixels with events called moving"),
    Column("recall_dense", "dense recall", "higher", "share of the movers' pixels called moving"),
    Column("detected", "detected", "higher", "share of the movers of at least 30 pixels that are detected"),
    Column("clutter", "clutter", "lower", "share of the static clutter's pixels with events called moving"),
    Column("resting", "resting", "lower", "the same for objects that could move but rest"),
    Column("background", "other static", "lower", "the same for everything else that is static"),
    Column("false_alarm_events", "false alarms", "lower", "share of events called moving in slices without movers"),
    Column("false_alarm_pixels", "f.a. pixels", "lower", "share of pixels called moving in slices without movers"),
    Column("flow", "flow", "lower", "endpoint error at pixels with events, mean over pixels, then slices", 1, "px/s"),
    Column("flow_dense", "dense flow", "lower", "the same at all pixels", 1, "px/s"),
    Column("flow_movers", "movers' flow", "lower", "the same at pixels with events on movers", 1, "px/s"),
    Column("flow_ratio", "flow / zero", "lower", "summed flow error at pixels with events over that of zero flow"),
    Column("flow_movers_ratio", "movers' flow / zero", "lower", "the same at pixels with events on movers"),
    Column(
        "camera_aee",
        "cam AEE",
        "lower",
        "error of the velocity of a camera that is not at rest, rescaled per slice to the true speed",
        3,
        "m/s",
    ),
    Column("aee_ratio", "AEE / zero", "lower", "summed camera AEE over that of a zero twist"),
    Column("camera_aee_depth", "cam AEE, depth", "lower", "cam AEE scaled by the median depths' ratio", 3, "m/s"),
    Column("aee_depth_ratio", "AEE, depth / zero", "lower", "the same, summed, over that of a zero twist"),
    Column("camera_rre", "cam RRE", "lower", "angle of R_predᵀ R_true of a slice, per second", 3, "rad/s"),
    Column("rre_ratio", "RRE / zero", "lower", "summed RRE over that of a zero twist"),
    Column("direction", "direction", "lower", "angle of camera velocities where it is not at rest; zero is 90", 1, "°"),
    Column(
        "object_aee", "obj AEE", "lower", "error of object velocity averaged in the true mask, true speed", 3, "m/s"
    ),
    Column("object_aee_depth", "obj AEE, depth", "lower", "the same, scaled by the median depths' ratio", 3, "m/s"),
    Column("object_aee_found", "obj AEE, found", "lower", "obj AEE over objects on which any is predicted", 3, "m/s"),
    Column("objects_found", "objects found", "higher", "share of moving objects on which any velocity is predicted"),
    Column("abs_rel", "AbsRel", "lower", "mean of |error| / true depth, median scale"),
    Column("rmse_log", "RMSE log", "lower", "root mean square of the log difference"),
    Column("silog", "SILog", "lower", "variance of the log difference, no square root"),
    Column("delta_1", "δ<1.25", "higher", "share of pixels within a factor of 1.25"),
    Column("delta_2", "δ<1.25²", "higher", "… of 1.25²"),
    Column("delta_3", "δ<1.25³", "higher", "… of 1.25³"),
    Column("abs_rel_events", "AbsRel, events", "lower", "AbsRel at pixels with events"),
    Column("rmse_log_events", "RMSE log, events", "lower", "RMSE log at pixels with events"),
    Column("silog_events", "SILog, events", "lower", "SILog at pixels with events"),
    Column("delta_1_events", "δ<1.25, events", "higher", "δ<1.25 at pixels with events"),
    Column("delta_2_events", "δ<1.25², events", "higher", "δ<1.25² at pixels with events"),
    Column("delta_3_events", "δ<1.25³, events", "higher", "δ<1.25³ at pixels with events"),
    Column("warp_gain", "warp gain", "higher", "variance of the image of warped events over that without warping"),
    Column("gyro_rre", "gyro RRE", "lower", "angle of R_predᵀ R_gyroscope of a slice, per second", 3, "rad/s"),
    Column("gyro_rre_ratio", "gyro RRE / zero", "lower", "summed gyro RRE over that of no rotation"),
    Column("consistency", "consistency", "higher", "IoU of a mask with the one before it moved along the flow, pooled"),
    Column("consistency_still", "without moving it", "higher", "the same, the mask before it left where it was"),
    Column("called_moving", "called moving", "lower", "share of events called moving; all wrong where nothing moves"),
)

STRATA = RESIDUALS | AREAS | FAMILIARITY
BY_STRATUM: tuple[Column, ...] = tuple(
    Column(f"{name}_{stratum}", header, "higher", meaning, of=words)
    for name, header, meaning in (
        ("iou", "IoU", "mean over frames with such movers, pixels of other movers left out"),
        ("recall", "recall", "share of such movers' pixels with events called moving"),
        ("detected", "detected", "share of those of at least 30 pixels that are detected"),
    )
    for stratum, words in STRATA.items()
)
COLUMNS: tuple[Column, ...] = (*OF_ALL, *(protocol.column for protocol in NEW), *BY_STRATUM)
BY_NAME = {column.name: column for column in COLUMNS}


def by_stratum(kind: str, strata: Mapping[str, str]) -> tuple[str, ...]:
    """Names of that score in each of the strata."""
    return tuple(f"{kind}_{stratum}" for stratum in strata)


OVERVIEW = "overview"
PROTOCOLS_SECTION = "published protocols"
WITHOUT_TRUTH = "without truth"
PROTOCOLS: tuple[Protocol, ...] = (
    Protocol("dense", BY_NAME["iou"], DENSE, MOVERS, "EV-IMO"),
    Protocol("dense-30px", BY_NAME["iou_30px"], DENSE, "frames with ≥ 30 moving px", "EV-IMO, small movers left out"),
    Protocol("dense-pooled", BY_NAME["iou_pooled"], DENSE, "all frames, summed", "IoU of segmentation"),
    *NEW[:4],
    Protocol("events", BY_NAME["event_iou"], EVENTS, "all frames, summed", "point IoU", SLICE),
    Protocol("events-frames", BY_NAME["event_iou_frames"], EVENTS, "frames with a moving event", "point IoU", SLICE),
    Protocol("events-own", BY_NAME["event_iou_own"], "events, by their own ids", "all frames, summed", "GConv", SLICE),
    *NEW[4:],
)
"""Every way to score a mask that somebody has published, in the order in which they are printed."""
SECTIONS: dict[str, tuple[str, ...]] = {
    OVERVIEW: (
        *("iou", "event_iou", "recall", "detected", "clutter", "false_alarm_events", "flow"),
        *("camera_aee", "camera_aee_depth", "camera_rre", "direction", "object_aee", "objects_found"),
        *("abs_rel", "delta_1"),
    ),
    PROTOCOLS_SECTION: tuple(protocol.column.name for protocol in PROTOCOLS),
    "moving mask": (
        *("iou", "iou_30px", "iou_pooled", "event_iou", "event_iou_frames", "event_iou_own"),
        *("recall", "recall_dense"),
        *("clutter", "resting", "background", "false_alarm_events", "false_alarm_pixels"),
    ),
    "by residual motion": by_stratum("iou", RESIDUALS) + by_stratum("recall", RESIDUALS),
    "by area": by_stratum("iou", AREAS) + by_stratum("recall", AREAS),
    "detection": ("detected", *by_stratum("detected", RESIDUALS), *by_stratum("detected", AREAS)),
    "objects seen in training": tuple(
        name for kind in ("iou", "recall", "detected") for name in by_stratum(kind, FAMILIARITY)
    ),
    "motion": (
        *("camera_aee", "aee_ratio", "camera_aee_depth", "aee_depth_ratio", "camera_rre", "rre_ratio", "direction"),
        *("object_aee", "object_aee_found", "object_aee_depth", "objects_found"),
    ),
    "flow": ("flow", "flow_ratio", "flow_movers", "flow_movers_ratio", "flow_dense"),
    "depth": (
        *("abs_rel", "rmse_log", "silog", "delta_1", "delta_2", "delta_3"),
        *("abs_rel_events", "rmse_log_events", "silog_events", "delta_1_events", "delta_2_events", "delta_3_events"),
    ),
    WITHOUT_TRUTH: (*("warp_gain", "gyro_rre", "gyro_rre_ratio", "consistency", "consistency_still", "called_moving"),),
}

CONVENTIONS: tuple[str, ...] = (
    "One estimate per 25 ms slice, scored in sensor pixels against the truth at its centre (at most 1 ms away).",
    "Scored are the pixels that the lens maps into the rectified image, the same for every row; no dilation.",
    "A mask is the moving probability above 0.5. Moving in truth: an object faster than"
    f" {100 * MOVING_MPS:g} cm/s or {MOVING_DEGPS} °/s relative to the static world at that instant,"
    " on tracked paths until it is slower than half of both; resting objects are background.",
    "Frames in which nothing moves in sight are left out of IoU; they count in pooled and event IoU and alone make up"
    " the false alarms.",
    "Residual motion of a mover: median over its pixels of how far their true flow differs from that of a static point"
    " at their depth, px per slice. Area: its share of the scored pixels. Familiar: of a family of shapes that training"
    " has seen, as the recording says.",
    "Detected: more than half of the mover's scored pixels lie in connected regions of the mask (eight neighbours) that"
    " lie more on this mover than off it. For a single region this is the rule of detection rates in the literature:"
    " more than half of the mover, and more of the mover than of anything else.",
    "Flow is on the plane Z = 1 times the sensor's focal length: px/s of a pinhole image, the lens left out.",
    "Velocities are in camera axes, objects relative to the static world, seen in at least 30 scored pixels.",
    "Scale of velocities from truth: the true norm per slice, or (depth) median true over median predicted depth."
    " A zero velocity stays zero: its error is the true speed.",
    "A camera slower than 5 cm/s is at rest: such slices are counted, and left out of AEE and direction.",
    f"The rows of true flow are no answers but ceilings: moving is where it differs by more than {THRESHOLD_PX} px per"
    " slice from what a static point does at the true depth, or (depth unknown) at any depth beyond"
    f" {NEAREST_M} m. One camera cannot tell more from motion alone in one instant.",
    "Object velocity is averaged over the true mask, zero where nothing is predicted, then brought to the true speed;"
    " objects of which nothing is predicted count with their true speed, and are left out of `obj AEE, found`.",
    "Depth over pixels with known depth, median scale per frame, natural logarithms, mean over frames.",
    f"The row {CONSTANT_DEPTH!r} says one depth for all pixels: scaled as every row is, the median of the true depths.",
    "Truth is exact geometry at its instant. Simulated events trail it by 1 to 4 ms, as slow pixels do (low-pass):"
    " even perfect masks do not have all of their events inside.",
    "Event density is the event count in a box of 1/13 of the width, over the mean of the frame; the oracle threshold"
    " is the one with the best IoU on these very recordings.",
)
