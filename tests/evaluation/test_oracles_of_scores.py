"""The scores of whole random slices against other people's programs: masks, events, boxes, velocities and flow."""

from dataclasses import replace

import numpy as np
import pytest
from pytest import approx
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation

from evimo.evaluation.labels import LabelledSlice, labelled
from evimo.evaluation.protocol_scores import Protocols
from evimo.evaluation.ratios import Scores, added
from evimo.evaluation.scores import prediction_scores
from evimo.evaluation.without_truth import BESIDE_PX, warp_gain
from evimo.events.events import Events
from evimo.recordings.prediction import Prediction
from evimo.recordings.truth import ObjectTruth, Truth

SIZE = (48, 64)
FOCAL_PX = (50.0, 60.0)


def random_slice(rng: np.random.Generator, *, objects: int) -> LabelledSlice:
    """Boxes that move at random velocities before a camera that does, 800 events, and a part that is not scored."""
    ids = np.zeros(SIZE, np.uint8)
    for name in range(1, objects + 1):
        y, x = rng.integers(0, 36), rng.integers(0, 50)
        ids[y : y + rng.integers(7, 20), x : x + rng.integers(7, 20)] = name
    everywhere, count = np.ones(SIZE, bool), 800
    x, y = rng.integers(0, SIZE[1], count), rng.integers(0, SIZE[0], count)
    t, p = np.sort(rng.integers(0, 25_000, count)), np.ones(count, np.int8)
    bodies = {name: ObjectTruth(np.zeros(3), rng.normal(0, 1, 3), np.zeros(3)) for name in range(1, objects + 1)}
    depth = rng.uniform(0.5, 3, SIZE).astype(np.float32)
    truth = Truth(12_500, depth, everywhere, ids, ~everywhere, rng.normal(0, 1, 6), bodies)
    return labelled(
        Events(x.astype(np.uint16), y.astype(np.uint16), t.astype(np.int64), p),
        truth,
        scored=rng.random(SIZE) < 0.9,
        focal_px=FOCAL_PX,
        dt_s=0.025,
        flow=rng.normal(0, 2, (2, *SIZE)).astype(np.float32),
        event_ids=ids[y, x],
    )


def random_masks(rng: np.random.Generator, frames: int) -> list[tuple[LabelledSlice, Prediction]]:
    """Slices with up to three movers, and masks that are right in most pixels."""
    pairs: list[tuple[LabelledSlice, Prediction]] = []
    for k in range(frames):
        sample = random_slice(rng, objects=k % 4)
        probability = np.where(rng.random(SIZE) < 0.8, sample.moving, rng.random(SIZE)).astype(np.float32)
        pairs.append((sample, Prediction(probability=probability, moving=probability > 0.5)))
    return pairs


def all_scores(pairs: list[tuple[LabelledSlice, Prediction]]) -> Scores:
    protocols = Protocols()
    return added([prediction_scores(p, s) | protocols.of_maps(p, s).scores for s, p in pairs])


def test_overlaps_and_recalls_are_those_of_torchmetrics():
    classification = pytest.importorskip("torchmetrics.classification")
    torch = pytest.importorskip("torch")
    pairs = random_masks(np.random.default_rng(20), 24)
    scores = all_scores(pairs)

    def pooled(judge, *, of_events=False, among=lambda sample: sample.scored):
        for sample, prediction in pairs:
            called, true = prediction.probability > 0.5, sample.moving
            where = (sample.events.y, sample.events.x) if of_events else among(sample)
            judge.update(torch.from_numpy(called[where]), torch.from_numpy(true[where]).int())
        return approx(float(judge.compute()), abs=1e-6)

    assert scores["iou_pooled"].value == pooled(classification.BinaryJaccardIndex())
    assert scores["recall_dense"].value == pooled(classification.BinaryRecall())
    assert scores["recall"].value == pooled(classification.BinaryRecall(), among=lambda sample: sample.active)
    assert scores["event_iou"].value == pooled(classification.BinaryJaccardIndex(), of_events=True)
    assert scores["event_iou_own"].value == scores["event_iou"].value  # here events are what their pixels are

    def mean_of_frames(among):
        judge = classification.BinaryJaccardIndex()
        found = []
        for sample, prediction in pairs:
            if (sample.moving & among(sample)).any():
                called, true = prediction.probability[among(sample)] > 0.5, sample.moving[among(sample)]
                found.append(float(judge(torch.from_numpy(called), torch.from_numpy(true).int())))
        return approx(np.mean(found), abs=1e-6)

    assert scores["iou"].value == mean_of_frames(lambda sample: sample.scored)
    assert scores["iou_event_pixels"].value == mean_of_frames(lambda sample: sample.active)


def test_false_alarms_are_those_of_torchmetrics():
    classification = pytest.importorskip("torchmetrics.classification")
    torch = pytest.importorskip("torch")
    pairs = random_masks(np.random.default_rng(21), 12)
    scores, of_pixels, of_events = all_scores(pairs), *(classification.BinarySpecificity() for _ in range(2))
    for sample, prediction in pairs:
        if not sample.moving.any():
            called = torch.from_numpy(prediction.probability > 0.5)
            of_pixels.update(called[torch.from_numpy(sample.scored)], torch.zeros(int(sample.scored.sum())).int())
            at = called[sample.events.y.astype(int), sample.events.x.astype(int)]
            of_events.update(at, torch.zeros(len(sample.events)).int())
    assert scores["false_alarm_pixels"].value == approx(1 - float(of_pixels.compute()), abs=1e-6)
    assert scores["false_alarm_events"].value == approx(1 - float(of_events.compute()), abs=1e-6)


def test_half_size_is_what_torchs_pooling_says():
    functional = pytest.importorskip("torch.nn.functional")
    torch = pytest.importorskip("torch")
    found = []
    pairs = random_masks(np.random.default_rng(22), 12)
    for sample, prediction in pairs:
        scored, called, true = (
            4 * functional.avg_pool2d(torch.from_numpy(each[None]).float(), 2)[0]
            for each in (sample.scored, (prediction.probability > 0.5) & sample.scored, sample.moving & sample.scored)
        )
        called, true = ((each / scored >= 0.5) & (scored > 0) for each in (called, true))
        if true.any():
            found.append(float((called & true).sum() / (called | true).sum()))
    assert all_scores(pairs)["iou_half"].value == approx(np.mean(found))


def test_detections_by_box_and_region_are_those_of_pycocotools():
    masks = pytest.importorskip("pycocotools.mask")
    rng = np.random.default_rng(23)
    parts, found = [], {"detected_box_iou": [], "detected_region": []}
    for _ in range(60):
        sample = replace(random_slice(rng, objects=3), scored=np.ones(SIZE, bool))
        ids = np.roll(sample.truth.ids, rng.integers(-5, 6, 2), axis=(0, 1)).astype(np.int32)
        prediction = Prediction(moving=ids > 0, ids=ids)
        parts.append(Protocols().of_maps(prediction, sample).scores)
        movers = [sample.truth.ids == mover.id for mover in sample.movers if mover.area_px >= 30]
        objects = [ids == name for name in np.unique(ids[ids > 0])]
        if not movers:
            continue
        encoded = [[masks.encode(np.asfortranarray(m.astype(np.uint8))) for m in each] for each in (objects, movers)]
        boxes = [masks.toBbox(each) for each in encoded]
        none = [0] * len(movers)
        found["detected_region"] += (masks.iou(*encoded, none) > 0.5).any(axis=0).tolist()
        found["detected_box_iou"] += (masks.iou(*boxes, none) > 0.5).any(axis=0).tolist()
    scores = added(parts)
    for name, each in found.items():
        assert 0.2 < np.mean(each) < 0.9
        assert scores[name].value == approx(np.mean(each))


def test_velocities_are_as_far_off_as_scipy_says():
    """Of the camera by both scales, its direction, and of objects: distances, and a rotation onto the truth."""
    rng = np.random.default_rng(24)
    parts, wanted = [], {name: [] for name in ("camera_aee", "camera_aee_depth", "direction", "object_aee")}
    for _ in range(40):
        sample = random_slice(rng, objects=2)
        ego, velocity = rng.normal(0, 1, 6), np.zeros((*SIZE, 3))
        rel_depth = rng.uniform(0.5, 2, SIZE)
        for name, body in sample.truth.objects.items():
            inside = (sample.truth.ids == name) & sample.scored
            velocity[inside] = said = rng.normal(0, 1, 3)
            if inside.sum() >= 30:
                length = np.linalg.norm(body.velocity) / np.linalg.norm(said)
                wanted["object_aee"].append(cdist([said * length], [body.velocity]).item())
        parts.append(prediction_scores(Prediction(ego=ego, rel_depth=rel_depth, velocity=velocity), sample))
        true = sample.truth.ego[:3]
        metres = np.median(sample.truth.depth[sample.scored].astype(float)) / np.median(rel_depth[sample.scored])
        wanted["camera_aee_depth"].append(cdist([ego[:3] * metres], [true]).item())
        wanted["camera_aee"].append(cdist([ego[:3] * np.linalg.norm(true) / np.linalg.norm(ego[:3])], [true]).item())
        onto, _ = Rotation.align_vectors([true / np.linalg.norm(true)], [ego[:3] / np.linalg.norm(ego[:3])])
        wanted["direction"].append(np.degrees(onto.magnitude()))
    scores = added(parts)
    for name, each in wanted.items():
        assert scores[name].value == approx(np.mean(each), rel=1e-6), name


def test_flow_is_as_far_off_as_scipy_says():
    rng = np.random.default_rng(25)
    parts, dense, at_events = [], [], []
    for _ in range(10):
        sample = random_slice(rng, objects=2)
        flow = rng.normal(0, 2, (2, *SIZE)).astype(np.float32)
        parts.append(prediction_scores(Prediction(flow=flow), sample))
        seen, true = (each.reshape(2, -1).T * FOCAL_PX for each in (flow, sample.flow))
        off = np.array([cdist([a], [b]).item() for a, b in zip(seen, true, strict=True)]).reshape(SIZE)
        dense.append(off[sample.scored].mean())
        at_events.append(off[sample.active].mean())
    scores = added(parts)
    assert scores["flow_dense"].value == approx(np.mean(dense), rel=1e-5)
    assert scores["flow"].value == approx(np.mean(at_events), rel=1e-5)


def test_warp_gain_is_that_of_torchs_bilinear_weights():
    """Images by `grid_sample`'s own derivative: what each pixel gives to a sample is what the sample gives to it."""
    functional = pytest.importorskip("torch.nn.functional")
    torch = pytest.importorskip("torch")
    rng = np.random.default_rng(26)
    at = rng.integers((8, 8), (SIZE[1] - 8, SIZE[0] - 8), (900, 2)).astype(float)
    flow, time_s = rng.normal(0, 150, (900, 2)), rng.uniform(-0.0125, 0.0125, 900)

    def variance(places):
        image = torch.zeros((1, 1, *SIZE), dtype=torch.float64, requires_grad=True)
        grid = torch.from_numpy((places + BESIDE_PX) / (np.array(SIZE[::-1]) - 1) * 2 - 1)[None, None]
        functional.grid_sample(image, grid, align_corners=True).sum().backward()
        return float(image.grad.var(correction=0))

    wanted = variance(at - flow * time_s[:, None]) / variance(at)
    assert warp_gain(at, flow, time_s, SIZE) == approx(wanted, rel=1e-9)
