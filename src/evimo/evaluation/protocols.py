"""The published ways to score motion masks, each by a name of its own: docs/metrics.md has them as formulas."""

from dataclasses import dataclass

from evimo.evaluation.column import Column
from evimo.evaluation.protocol_scores import SPIKEMS_DILATION_PX, SPIKEMS_RATIOS, SPIKEMS_US

SLICE = "25 ms"
DENSE, EVENT_PIXELS, EVENTS, OBJECTS = "pixels", "pixels with events", "events", "objects"
MOVERS = "frames with movers"


@dataclass(frozen=True, slots=True)
class Protocol:
    """One way to score, as it is printed.

    name:    of its own, that people can cite.
    column:  the score that it is.
    support: what is counted.
    kept:    which slices, or what of them; the report prints how many.
    window:  of the events; None where none are looked at.
    source:  who uses it.
    """

    name: str
    column: Column
    support: str
    kept: str
    source: str
    window: str | None = None


def _column(name: str, header: str, meaning: str) -> Column:
    return Column(name, header, "higher", meaning)


def _spikems(ratio: float) -> tuple[Protocol, Protocol]:
    """SpikeMS at one ratio, and the share of the slices that the ratio keeps."""
    window = f"±{SPIKEMS_US // 1000} ms"
    side = SPIKEMS_DILATION_PX
    rule = f"≥ 30 moving px, events off/on ≤ {ratio:g}"
    meaning = (
        f"IoU of pixels with events within {window}, true masks dilated {side}x{side}, mean over frames with {rule}"
    )
    score = _column(f"iou_spikems_{ratio:g}", f"SpikeMS {ratio:g}", meaning)
    kept = _column(f"spikems_kept_{ratio:g}", f"SpikeMS {ratio:g}, kept", f"share of all frames with {rule}")
    return (
        Protocol(f"spikems-{ratio:g}", score, f"{EVENT_PIXELS}, truth dilated {side}x{side}", rule, "SpikeMS", window),
        Protocol(f"spikems-{ratio:g}-kept", kept, "frames", "all frames", "SpikeMS", window),
    )


NEW: tuple[Protocol, ...] = (
    Protocol(
        "dense-half",
        _column("iou_half", "IoU, half size", "dense, both masks at half the size (half of a 2x2 block), as iou"),
        DENSE,
        MOVERS,
        "masks that come at half the size",
    ),
    Protocol(
        "dense-all-frames",
        _column("iou_all_frames", "IoU, all frames", "dense, mean over all frames; 1 where neither mask has a pixel"),
        DENSE,
        "all frames",
        "EV-LayerSegNet",
    ),
    Protocol(
        "dense-best-30",
        _column("iou_best30", "IoU, best 30 %", "dense, mean over the best 30 % of the frames with movers"),
        DENSE,
        "best 30 % of those",
        "reported by some works",
    ),
    Protocol(
        "class-mean",
        _column(
            "iou_classes", "mIoU", "mean of the dense IoU of movers and of background, mean over frames with movers"
        ),
        DENSE,
        MOVERS,
        "mIoU of segmentation",
    ),
    Protocol(
        "event-pixels",
        _column(
            "iou_event_pixels", "IoU, event pixels", "IoU of pixels with events, each once, mean over frames with any"
        ),
        EVENT_PIXELS,
        "frames with a moving event",
        "GConv, Un-EVIMO",
        SLICE,
    ),
    *(protocol for ratio in SPIKEMS_RATIOS for protocol in _spikems(ratio)),
    Protocol(
        "hulls",
        _column("iou_hulls", "IoU, hulls", "dense IoU of the convex hulls of the events of each predicted object"),
        "pixels inside hulls",
        MOVERS,
        "EMSGC",
        SLICE,
    ),
    Protocol(
        "detection-box",
        _column(
            "detected_box",
            "detected, box",
            "share of movers found by box: over half of the true box, and more of the predicted one on it than off",
        ),
        "bounding boxes",
        "movers of ≥ 30 px",
        "Mitrokhin 2018",
    ),
    Protocol(
        "detection-box-iou",
        _column("detected_box_iou", "detected, box IoU", "the same with more than half of the union of the boxes"),
        "bounding boxes",
        "movers of ≥ 30 px",
        "EED in later works",
    ),
    Protocol(
        "detection-region",
        _column("detected_region", "detected, region", "share of movers that one predicted object overlaps by IoU > ½"),
        OBJECTS,
        "movers of ≥ 30 px",
        "0-MMS",
    ),
    Protocol(
        "detection-mask",
        _column(
            "detected_mask",
            "detected, whole mask",
            "share of all frames with dense IoU ≥ ½ (1 if both are empty) and no more false pixels than right ones",
        ),
        DENSE,
        "all frames",
        "EV-LayerSegNet",
    ),
    Protocol(
        "instance-iou",
        _column("instance_iou", "IoU, objects", "IoU of each mover with its match (Hungarian), 0 without one, pooled"),
        OBJECTS,
        "movers of ≥ 30 px",
        "EvInsMOS",
    ),
    Protocol(
        "instance-iou-matched",
        _column("instance_iou_matched", "IoU, matched", "the same over movers with a match"),
        OBJECTS,
        "matched movers",
        "mIoU over matched instances",
    ),
    Protocol(
        "coco-ap",
        _column(
            "ap", "AP", "mean over IoU 0.5 to 0.95 of COCO's average precision of masks, movers of at least 30 pixels"
        ),
        OBJECTS,
        "all frames",
        "COCO",
    ),
    Protocol("coco-ap50", _column("ap50", "AP50", "the same at IoU 0.5"), OBJECTS, "all frames", "COCO"),
    Protocol(
        "evinsmos-ap",
        _column("ap_evinsmos", "AP, ≥ 400 px", "AP over frames with at least 400 moving pixels"),
        OBJECTS,
        "frames with ≥ 400 moving px",
        "EvInsMOS",
    ),
    Protocol(
        "identity-switches",
        Column(
            "identity_switches",
            "id switches",
            "lower",
            "changes of the name under which a mover is found (IoU > ½), over finds",
        ),
        OBJECTS,
        "found movers of ≥ 30 px",
        "CLEAR MOT",
    ),
)
"""Those of which the report has no other column."""
