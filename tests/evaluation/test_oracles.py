"""Metrics against other people's programs on random input; each is left out where its program is not installed."""

import numpy as np
import pytest
from pytest import approx
from scipy import ndimage
from scipy.optimize import linear_sum_assignment
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from evimo.evaluation.assignment import best_assignment
from evimo.evaluation.instances import Identities, instances_of, matched_scores, overlaps
from evimo.evaluation.labels import LabelledSlice, labelled
from evimo.evaluation.metrics import depth_errors, direction_error, rotation_error
from evimo.evaluation.outlines import boxes_of, hulls
from evimo.evaluation.protocol_scores import class_mean, event_scores
from evimo.evaluation.ranked import Ranked, ranked_detections
from evimo.events.events import Events
from evimo.recordings.truth import ObjectTruth, Truth

SIZE = (48, 64)
STILL = np.zeros(3)


def random_ids(rng: np.random.Generator, count: int) -> np.ndarray:
    """Boxes of random sizes, the later ones in front."""
    ids = np.zeros(SIZE, np.uint8)
    for name in range(1, count + 1):
        y, x = rng.integers(0, 40), rng.integers(0, 56)
        ids[y : y + rng.integers(3, 16), x : x + rng.integers(3, 16)] = name
    return ids


def slice_of(ids: np.ndarray, events: Events | None = None) -> LabelledSlice:
    """All objects move 1 m/s."""
    if events is None:
        events = Events(np.zeros(0, np.uint16), np.zeros(0, np.uint16), np.zeros(0, np.int64), np.zeros(0, np.int8))
    movers = {int(key): ObjectTruth(STILL, np.array([1.0, 0, 0]), STILL) for key in np.unique(ids[ids > 0])}
    everywhere = np.ones(SIZE, bool)
    truth = Truth(12_500, np.ones(SIZE, np.float32), everywhere, ids, ~everywhere, np.zeros(6), movers)
    return labelled(events, truth, scored=everywhere, focal_px=(50.0, 50.0), dt_s=0.025)


def disturbed(rng: np.random.Generator, ids: np.ndarray) -> np.ndarray:
    """The same objects moved by a few pixels, renamed, some lost, and some that are not there."""
    names = rng.permutation(20) + 1
    predicted = np.zeros(SIZE, np.int32)
    for name in np.unique(ids[ids > 0]):
        if rng.random() < 0.85:
            shift = rng.integers(-1, 2, 2)
            predicted[np.roll(ids == name, shift, axis=(0, 1))] = names[name]
    false = random_ids(rng, int(rng.integers(0, 3)))
    return np.where((predicted == 0) & (false > 0), false.astype(np.int32) + 100, predicted)


def test_average_precision_is_that_of_pycocotools():
    coco_module = pytest.importorskip("pycocotools.coco")
    masks, evaluation = pytest.importorskip("pycocotools.mask"), pytest.importorskip("pycocotools.cocoeval")
    rng = np.random.default_rng(1)
    ranked, truths, answers = Ranked(), [], []
    certainty = rng.permutation(5000) / 5000  # no two alike
    for image in range(1, 61):
        ids = random_ids(rng, int(rng.integers(0, 5)))
        predicted = disturbed(rng, ids)
        probability = np.zeros(SIZE, np.float32)
        for name in np.unique(predicted[predicted > 0]):
            probability[predicted == name] = score = np.float32(certainty[len(answers)])
            rle = masks.encode(np.asfortranarray(predicted == name).astype(np.uint8))
            answers.append({"image_id": image, "category_id": 1, "segmentation": rle, "score": float(score)})
        for name in np.unique(ids[ids > 0]):
            rle = masks.encode(np.asfortranarray(ids == name).astype(np.uint8))
            truths.append(
                {"id": len(truths) + 1, "image_id": image, "category_id": 1, "segmentation": rle, "iscrowd": 0}
                | {"area": int(np.count_nonzero(ids == name)), "bbox": [0, 0, 1, 1]}
            )
        pairs = overlaps(instances_of(predicted, probability, np.ones(SIZE, bool)), slice_of(ids))
        ranked = ranked + ranked_detections(pairs, moving_px=int(np.count_nonzero(ids)))
    coco = coco_module.COCO()
    coco.dataset = {
        "info": {},
        "images": [{"id": k, "height": SIZE[0], "width": SIZE[1]} for k in range(1, 61)],
        "categories": [{"id": 1, "name": "mover"}],
        "annotations": truths,
    }
    coco.createIndex()
    judge = evaluation.COCOeval(coco, coco.loadRes(answers), "segm")
    judge.params.areaRng, judge.params.areaRngLbl = [[30, 1e10]], ["all"]
    judge.evaluate()
    judge.accumulate()
    precision = judge.eval["precision"][:, :, 0, 0, -1]
    scores = ranked.scores()
    assert 0.05 < scores["ap"].top < scores["ap50"].top < 0.9
    assert scores["ap"].value == approx(precision.mean(), abs=1e-9)
    assert scores["ap50"].value == approx(precision[0].mean(), abs=1e-9)


def test_identity_switches_are_those_of_motmetrics():
    motmetrics = pytest.importorskip("motmetrics")
    rng = np.random.default_rng(2)
    ids = np.zeros(SIZE, np.uint8)
    ids[2:14, 2:14], ids[20:32, 30:42], ids[34:46, 4:20] = 1, 2, 3
    identities, switches, finds = Identities(), 0.0, 0.0
    judge = motmetrics.MOTAccumulator(auto_id=True)
    for _ in range(200):
        predicted = disturbed(rng, ids)
        predicted[ids == 1] = np.where(rng.random() < 0.9, 7, 8)
        pairs = overlaps(instances_of(predicted, None, np.ones(SIZE, bool)), slice_of(ids))
        score = identities.scores(pairs).get("identity_switches")
        switches, finds = switches + (score.top if score else 0), finds + (score.bottom if score else 0)
        distance = 1 - pairs.iou.T
        judge.update(pairs.true_names, pairs.names, np.where(distance < 0.5, distance, np.nan))
    summary = motmetrics.metrics.create().compute(judge, metrics=["num_switches", "num_matches"], name="all")
    assert switches > 20
    assert switches == summary["num_switches"]["all"]
    assert finds == summary["num_matches"]["all"] + summary["num_switches"]["all"]


def test_matched_overlap_is_that_of_the_best_of_all_assignments():
    from itertools import permutations

    rng = np.random.default_rng(3)
    for _ in range(50):
        ids = random_ids(rng, 4)
        sample = slice_of(ids)
        pairs = overlaps(instances_of(disturbed(rng, ids), None, np.ones(SIZE, bool)), sample)
        iou = pairs.iou[:, pairs.true_px >= 30]
        padded = np.zeros((max(iou.shape), iou.shape[1]))
        padded[: len(iou)] = iou
        columns = range(iou.shape[1])
        best = max((sum(padded[rows, columns]) for rows in permutations(range(len(padded)), iou.shape[1])), default=0)
        score = matched_scores(pairs).get("instance_iou")
        assert (score.top if score else 0) == approx(best)


def test_overlaps_of_masks_are_those_of_torchmetrics():
    classification = pytest.importorskip("torchmetrics.functional.classification")
    torch = pytest.importorskip("torch")
    rng = np.random.default_rng(4)
    for _ in range(20):
        predicted, true = rng.random((2, *SIZE)) < rng.random((2, 1, 1))
        of_class = classification.multiclass_jaccard_index(
            torch.from_numpy(predicted).long(), torch.from_numpy(true).long(), num_classes=2, average="macro"
        )
        assert class_mean(predicted, true, np.ones(SIZE, bool)) == approx(float(of_class), abs=1e-6)


def test_depth_errors_are_those_of_torchmetrics():
    regression = pytest.importorskip("torchmetrics.functional.regression")
    torch = pytest.importorskip("torch")
    rng = np.random.default_rng(5)
    true = rng.uniform(0.5, 4, SIZE)
    predicted = true * np.exp(rng.normal(0, 0.3, SIZE))
    errors = depth_errors(predicted, true, np.ones(SIZE, bool), scale="none")
    seen, known = torch.from_numpy(predicted).ravel(), torch.from_numpy(true).ravel()
    assert errors.abs_rel == approx(float(regression.mean_absolute_percentage_error(seen, known)))
    assert errors.rmse_log == approx(float(regression.mean_squared_error(seen.log(), known.log(), squared=False)))
    assert errors.silog == approx(float((seen.log() - known.log()).var(correction=0)))
    ratio = torch.maximum(seen / known, known / seen)
    for k, share in enumerate((errors.delta_1, errors.delta_2, errors.delta_3), 1):
        assert share == approx(float((ratio < 1.25**k).double().mean()))


def test_rotation_errors_are_those_of_scipy():
    rng = np.random.default_rng(6)
    predicted, true = rng.normal(0, 3, (2, 500, 3))
    turn = Rotation.from_rotvec(predicted * 0.025).inv() * Rotation.from_rotvec(true * 0.025)
    assert rotation_error(predicted, true, dt_s=0.025) == approx(turn.magnitude() / 0.025)
    cosine = (predicted * true).sum(axis=1) / np.linalg.norm(predicted, axis=1) / np.linalg.norm(true, axis=1)
    assert direction_error(predicted, true) == approx(np.degrees(np.arccos(cosine)))


def test_hulls_hold_the_pixels_that_scipys_hull_holds():
    rng = np.random.default_rng(7)
    for _ in range(20):
        x, y = rng.integers(5, 60, 15), rng.integers(5, 40, 15)
        drawn = hulls(x.astype(np.uint16), y.astype(np.uint16), np.ones(15, np.int64), SIZE)
        hull = ConvexHull(np.stack((x, y), axis=1))
        columns, rows = np.meshgrid(np.arange(SIZE[1]), np.arange(SIZE[0]))
        signed = (
            np.einsum("kc,cyx->kyx", hull.equations[:, :2], np.stack((columns, rows))) + hull.equations[:, 2:, None]
        )
        distance = signed.max(axis=0)
        assert np.array_equal(drawn, distance <= 1e-9)  # inside and on the border


def test_boxes_are_those_of_the_pixels():
    rng = np.random.default_rng(8)
    ids = random_ids(rng, 5).astype(np.int32)
    wanted = []
    for name in np.unique(ids[ids > 0]):
        rows, columns = np.nonzero(ids == name)
        wanted.append((columns.min(), rows.min(), columns.max(), rows.max()))
    assert boxes_of(ids) == wanted


def test_spikems_is_what_scipys_dilation_and_sets_of_pixels_say():
    rng = np.random.default_rng(9)
    compared = 0
    for _ in range(40):
        ids = random_ids(rng, 8)
        count = 600
        x, y = rng.integers(0, SIZE[1], count), rng.integers(0, SIZE[0], count)
        t = np.sort(rng.integers(0, 25_000, count))
        events = Events(x.astype(np.uint16), y.astype(np.uint16), t.astype(np.int64), np.ones(count, np.int8))
        called = rng.random(count) < 0.4
        scores = event_scores(called, slice_of(ids, events))
        wide = ndimage.binary_dilation(ids > 0, np.ones((5, 5)))
        near = [k for k in range(count) if 2_500 <= t[k] < 22_500]
        inside = sum(bool(wide[y[k], x[k]]) for k in near)
        true = {(x[k], y[k]) for k in near if wide[y[k], x[k]]}
        predicted = {(x[k], y[k]) for k in near if called[k]}
        kept = inside > 0 and (ids > 0).sum() >= 30 and (len(near) - inside) / inside <= 3
        assert scores["spikems_kept_3"].top == kept
        if kept:
            compared += 1
            assert scores["iou_spikems_3"].value == approx(len(true & predicted) / len(true | predicted))
    assert compared > 5


def test_assignments_are_worth_what_scipys_are():
    rng = np.random.default_rng(10)
    for _ in range(300):
        gain = rng.random(rng.integers(0, 9, 2)) * (rng.random() < 0.9)
        gain[gain < 0.4] = 0
        rows = best_assignment(gain)
        taken = rows[rows >= 0]
        assert len(set(taken.tolist())) == len(taken)
        assert gain[taken, np.flatnonzero(rows >= 0)].sum() == approx(gain[linear_sum_assignment(-gain)].sum())
