"""Every kind of predictions scored against a recording: the truth itself is perfect, the rest is counted."""

import json
import re
from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest
from pytest import approx

from evimo.cli import main
from evimo.errors import BadFile, BadInput
from evimo.evaluation.columns import OF_ALL, PROTOCOLS
from evimo.evaluation.report import LABELS, MODEL, load_report
from evimo.recordings.evimo1_writer import Evimo1Writer
from evimo.streaming.evaluating_predictions import UNLABELLED, UNUSED, evaluate_predictions

CENTRES_US = np.array([12_500 + 25_000 * k for k in range(6)])
PERFECT_MASKS = (
    *("iou", "iou_30px", "iou_pooled", "iou_all_frames", "iou_best30", "iou_classes", "event_iou", "event_iou_frames"),
    *("event_iou_own", "iou_event_pixels", "iou_hulls", "detected", "detected_box", "detected_box_iou"),
    *("detected_region", "detected_mask", "instance_iou", "instance_iou_matched", "ap", "ap50"),
)
PERFECT_LABELS = ("event_iou", "event_iou_frames", "event_iou_own", "iou_event_pixels", "iou_hulls")
NO_PREDICTION = "slices WITHOUT a prediction, not scored"


def test_true_ids_as_pictures_npz_and_estimates_are_perfect_by_every_protocol(
    save_pictures, save_estimates, truth, all_ids, tmp_path
):
    np.savez(tmp_path / "ids.npz", ids=all_ids, times=CENTRES_US)
    np.savez_compressed(
        tmp_path / "both.npz", ids=all_ids, masks=(all_ids > 0) * np.float32(0.8), times=CENTRES_US * 1e-6
    )
    saved = [
        save_pictures(tmp_path / "png", all_ids * 40),
        *(tmp_path / "ids.npz", tmp_path / "both.npz"),
        save_estimates(tmp_path / "run" / "estimates.h5", all_ids),
        tmp_path / "run",
    ]
    for path in saved:
        report = evaluate_predictions(path, truth)
        for name in PERFECT_MASKS:
            assert report.value(MODEL, name) == approx(1), (path, name)
        assert report.value(MODEL, "identity_switches") == 0
        assert report.counts["slices"] == 6 and report.counts[NO_PREDICTION] == 0 and report.counts[UNUSED] == 0


def test_labels_of_events_as_csv_npz_and_our_own_file_are_perfect(save_labels, truth, labelled_rows, tmp_path):
    t, x, y, label = labelled_rows.T
    np.savez(tmp_path / "order.npz", labels=label)
    np.savez(tmp_path / "place.npz", labels=label, t=t, x=x, y=y)
    np.savetxt(tmp_path / "order.csv", label, fmt="%d")
    swapped = save_labels(tmp_path / "place.csv", labelled_rows[:, [3, 1, 2, 0]], "label,x,y,t")
    seconds = tmp_path / "seconds.csv"
    seconds.write_text("t x y label\n" + "".join(f"{a / 1e6:.6f} {b} {c} {d}\n" for a, b, c, d in labelled_rows))
    with h5py.File(tmp_path / "events.h5", "w") as file:
        for name, column in zip(("t_us", "x", "y", "object"), labelled_rows.T, strict=True):
            file[name] = column
    for name in ("order.npz", "place.npz", "order.csv", swapped.name, seconds.name, "events.h5"):
        report = evaluate_predictions(tmp_path / name, truth)
        for score in PERFECT_LABELS:
            assert report.value(MODEL, score) == approx(1), (name, score)
        assert report.value(MODEL, "iou") is None  # labels of events are no dense mask
        assert report.counts[NO_PREDICTION] == 0 and report.counts[UNLABELLED] == 0


def test_a_mask_without_names_has_its_regions_for_objects_and_no_identities(save_pictures, truth, all_ids, tmp_path):
    report = evaluate_predictions(save_pictures(tmp_path / "png", (all_ids > 0) * np.uint8(255)), truth)
    assert report.value(MODEL, "ap") == approx(1)  # the two movers do not touch
    assert report.value(MODEL, "identity_switches") is None


def test_a_shifted_mask_scores_what_counting_says(save_pictures, truth, all_ids, tmp_path):
    shifted = np.roll(all_ids, 2, axis=2)
    report = evaluate_predictions(save_pictures(tmp_path / "png", shifted), truth)
    one, two = (10 * 10, 14 * 10), (6 * 8, 10 * 8)  # cut and union of each object
    with_two = (one[0] + two[0]) / (one[1] + two[1])
    assert report.value(MODEL, "iou") == approx((4 * with_two + 2 * one[0] / one[1]) / 6)
    assert report.value(MODEL, "iou_best30") == approx(one[0] / one[1])  # the best two of six
    assert report.value(MODEL, "iou_pooled") == approx((6 * one[0] + 4 * two[0]) / (6 * one[1] + 4 * two[1]))
    assert report.value(MODEL, "instance_iou") == approx((6 * one[0] / one[1] + 4 * two[0] / two[1]) / 10)
    assert report.value(MODEL, "ap50") == approx(1)
    assert report.value(MODEL, "detected_box") == report.value(MODEL, "detected_region") == 1
    background = [(1200 - one[1] - two[1]) / (1200 - one[0] - two[0]), (1200 - one[1]) / (1200 - one[0])]
    classes = [(with_two + background[0]) / 2, (one[0] / one[1] + background[1]) / 2]
    assert report.value(MODEL, "iou_classes") == approx((4 * classes[0] + 2 * classes[1]) / 6)


def test_names_that_change_are_identity_switches(save_pictures, truth, all_ids, tmp_path):
    renamed = all_ids.copy()
    renamed[3:][all_ids[3:] == 1] = 7
    report = evaluate_predictions(save_pictures(tmp_path / "png", renamed), truth)
    assert report.rows[MODEL]["identity_switches"].top == 1
    assert report.rows[MODEL]["identity_switches"].bottom == 10


def test_slices_without_a_prediction_are_counted_and_said(save_pictures, truth, all_ids, tmp_path, capsys):
    pictures = save_pictures(tmp_path / "png", all_ids[:4], [*CENTRES_US[:3], 81_000])
    assert main(["evaluate", str(pictures), "--truth", str(truth), "--out", str(tmp_path / "out")]) == 0
    report = load_report(tmp_path / "out" / "report.json")
    assert (report.counts["slices"], report.counts[NO_PREDICTION], report.counts[UNUSED]) == (3, 3, 1)
    for text in (capsys.readouterr().out, (tmp_path / "out" / "report.md").read_text()):
        assert "3 slices WITHOUT a prediction" in text and "spikems-1.5-kept" in text and "±10 ms" in text
    assert evaluate_predictions(pictures, truth, within_ms=10).counts["slices"] == 4


def test_events_without_a_label_are_counted_and_static(save_labels, truth, labelled_rows, tmp_path):
    report = evaluate_predictions(save_labels(tmp_path / "some.csv", labelled_rows[labelled_rows[:, 3] == 1]), truth)
    pixels = {1: 6 * 120, 2: 4 * 64}
    assert report.counts[UNLABELLED] == 6 * 1200 - pixels[1]
    assert report.value(MODEL, "event_iou") == approx(pixels[1] / (pixels[1] + pixels[2]))
    late = save_labels(tmp_path / "late.csv", labelled_rows[2 * 1200 :])
    assert evaluate_predictions(late, truth).counts[NO_PREDICTION] == 2


def test_a_run_with_labels_has_a_row_for_them_and_tells_its_model(
    save_estimates, truth, all_ids, labelled_rows, tmp_path
):
    save_estimates(tmp_path / "run" / "estimates.h5", all_ids)
    with h5py.File(tmp_path / "run" / "events.h5", "w") as file:
        file.attrs.update({"recording": "a", "model": "tiny", "model_sha256": "0123"})
        for name, column in zip(("t_us", "x", "y", "object"), labelled_rows.T, strict=True):
            file[name] = column if name != "object" else column * (column == 1)
    (tmp_path / "run" / "objects.csv").write_text(
        "t_us,object,rel_vx,rel_vy,rel_vz\n" + "".join(f"{t},1,0.1,0,0\n" for t in CENTRES_US)
    )
    report = evaluate_predictions(tmp_path / "run", truth)
    assert list(report.rows)[:2] == [MODEL, LABELS]
    assert report.value(MODEL, "event_iou") == 1 and report.value(LABELS, "event_iou") == approx(720 / (720 + 256))
    assert report.settings["model sha256"] == "0123"
    assert report.value(MODEL, "camera_aee_depth") == approx(0)  # 0.15 x 2 m
    assert report.value(MODEL, "objects_found") == approx(6 / 10)
    assert report.value(MODEL, "object_aee") == approx(0.2 * 4 / 10)
    assert report.value(MODEL, "object_aee_found") == approx(0)
    with h5py.File(tmp_path / "run" / "events.h5", "a") as file:
        file.attrs["model_sha256"] = "4567"
    with pytest.raises(BadFile, match="different models"):
        evaluate_predictions(tmp_path / "run", truth)


def test_several_recordings_take_predictions_of_their_names(
    save_pictures, save_estimates, save_recording, all_ids, tmp_path, capsys
):
    for name in ("x/s", "y/s"):
        save_recording(tmp_path / "truth" / name)
    np.savez(tmp_path / "wrong.npz", ids=all_ids, times=CENTRES_US)
    for name in ("x", "y"):
        ids = all_ids if name == "x" else 0 * all_ids
        save_estimates(tmp_path / "answers" / name / "s" / "estimates.h5", ids, recording="s")
    report = evaluate_predictions(tmp_path / "answers", [tmp_path / "truth"])
    assert report.counts["recordings"] == 2 and report.value(MODEL, "iou") == approx(0.5)
    with pytest.raises(BadInput, match="holds no predictions of"):
        evaluate_predictions(tmp_path / "wrong.npz", tmp_path / "truth")
    for name in ("x", "y"):
        (tmp_path / "answers" / name / "s" / "estimates.h5").unlink()
        (tmp_path / "answers" / name / "s").rmdir()
        (tmp_path / "answers" / name).rmdir()
    save_pictures(tmp_path / "answers" / "s", all_ids)
    with pytest.raises(BadInput, match="several of the recordings"):
        evaluate_predictions(tmp_path / "answers", tmp_path / "truth")


def test_pictures_of_any_name_take_their_times_from_a_list(truth, all_ids, tmp_path):
    folder = tmp_path / "png"
    folder.mkdir()
    for k, ids in enumerate(all_ids):
        cv2.imwrite(str(folder / f"frame_{k}.png"), ids.astype(np.uint16) * 1000)
    lines = [f"frame_{k}.png,{t_us}" for k, t_us in enumerate(CENTRES_US)]
    for text in (
        "\n".join(lines),
        "\n".join(["name,t", *(f"frame_{k}.png, {t / 1e6}" for k, t in enumerate(CENTRES_US))]),
    ):
        (folder / "times.csv").write_text(text)
        assert evaluate_predictions(folder, truth).value(MODEL, "ap") == approx(1)


def test_numbers_from_estimates_alone_are_those_of_the_report(save_estimates, truth, all_ids, tmp_path):
    """As a reader of docs/metrics.md would: NumPy, the file, and the truth."""
    path = save_estimates(tmp_path / "run" / "estimates.h5", np.roll(all_ids, 1, axis=1))
    report = evaluate_predictions(path, truth)
    with h5py.File(path) as file:
        moving = file["moving_probability"][:] > 127.5
        seen = file["rel_depth"][:].astype(float)
        ego = file["ego"][:]
    true, metres = all_ids > 0, np.where(all_ids > 0, 1.0, 2.0)
    frames = [(p & t).sum() / (p | t).sum() for p, t in zip(moving, true, strict=True)]
    assert report.value(MODEL, "iou") == approx(np.mean(frames), abs=1e-6)
    scale = [np.median(t) / np.median(p) for p, t in zip(seen, metres, strict=True)]
    logs = [np.log(p * s) - np.log(t) for p, s, t in zip(seen, scale, metres, strict=True)]
    assert report.value(MODEL, "silog") == approx(np.mean([(d**2).mean() - d.mean() ** 2 for d in logs]), abs=1e-6)
    errors = [np.linalg.norm(v[:3] * s - [0.3, 0, 0]) for v, s in zip(ego, scale, strict=True)]
    assert report.value(MODEL, "camera_aee_depth") == approx(np.mean(errors), abs=1e-6)


def test_the_report_is_saved_with_what_its_numbers_depend_on(save_estimates, truth, all_ids, tmp_path):
    path = save_estimates(tmp_path / "run" / "estimates.h5", all_ids)
    assert main(["evaluate", str(path), "--truth", str(truth), "--out", str(tmp_path / "out")]) == 0
    saved = json.loads((tmp_path / "out" / "report.json").read_text())
    assert saved["format"] == 4
    assert saved["settings"]["model sha256"] == "0123" and saved["settings"]["masks within ms"] == 1
    assert len(saved["ranked"][MODEL]["frame_iou"]) == 6
    page = (tmp_path / "out" / "report.md").read_text()
    assert "| coco-ap | 1.000 |" in page and "IoU of model by protocol: 0.5" in page  # true masks are dilated


def test_the_page_of_metrics_names_every_protocol_and_its_block_gives_the_same_numbers(
    save_estimates, truth, all_ids, tmp_path
):
    page = (Path(__file__).parents[2] / "docs" / "metrics.md").read_text()
    assert [
        protocol.name for protocol in PROTOCOLS if f"`{protocol.name}`" not in page and "spikems" not in protocol.name
    ] == []
    told = [{column.name, re.sub("_(ratio|events)$", "", column.name)} for column in OF_ALL]
    missing = {min(names) for names in told if not any(f"`{name}`" in page for name in names)}
    assert missing == {"delta_2"}  # of delta_1 to delta_3
    path = save_estimates(tmp_path / "run" / "estimates.h5", np.roll(all_ids, 2, axis=2))
    block: dict = {"recording": truth, "estimates": path}
    exec(re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL)[0], block)
    report = evaluate_predictions(path, truth)
    assert len(block["recomputed"]) == 7
    for name, value in block["recomputed"].items():
        assert report.value(MODEL, name) == approx(value, abs=1e-4), name


def test_one_mask_may_serve_two_slices_and_is_counted_once(truth, all_ids, tmp_path):
    np.savez(tmp_path / "ends.npz", ids=all_ids[:3], times=[25_000, 75_000, 125_000])
    report = evaluate_predictions(tmp_path / "ends.npz", truth, within_ms=12.5)
    assert report.counts["slices"] == 6 and report.counts[UNUSED] == 0


def test_a_heading_may_be_a_comment(save_labels, truth, labelled_rows, tmp_path):
    path = save_labels(tmp_path / "labels.txt", labelled_rows, "# timestamp,x,y,cluster")
    assert evaluate_predictions(path, truth).value(MODEL, "event_iou") == 1


def test_recordings_in_the_layout_of_ev_imo_take_predictions_as_folders_do(
    save_recording, truth, all_ids, labelled_rows, tmp_path
):
    file = save_recording(tmp_path / "v1" / "c.npz", Evimo1Writer)
    np.savez(tmp_path / "ids.npz", ids=all_ids, times=CENTRES_US)
    np.savez(tmp_path / "labels.npz", labels=labelled_rows[:, 3])
    for path in ("ids.npz", "labels.npz"):
        of_file, of_folder = (evaluate_predictions(tmp_path / path, each) for each in (file, truth))
        assert of_file.rows[MODEL] == of_folder.rows[MODEL] and of_file.counts["slices"] == 6
    (tmp_path / "all").mkdir()
    (tmp_path / "ids.npz").rename(tmp_path / "all" / "c.npz")
    assert evaluate_predictions(tmp_path / "all", file).value(MODEL, "iou") == 1


def test_slices_of_which_a_run_says_that_they_have_no_events_are_counted_alone(
    save_estimates, truth, all_ids, tmp_path
):
    path = save_estimates(tmp_path / "estimates.h5", all_ids)
    with h5py.File(path, "a") as file:
        file["has_events"][2], file["ego"][2] = False, np.nan
    report = evaluate_predictions(path, truth)
    assert (report.counts["slices"], report.counts["slices without events"]) == (5, 1)
    assert report.value(MODEL, "camera_rre") == approx(0)


def test_a_run_that_does_not_say_what_moves_is_scored_by_the_rest(save_estimates, truth, all_ids, tmp_path):
    path = save_estimates(tmp_path / "run" / "estimates.h5", all_ids)
    before = evaluate_predictions(path, truth)
    with h5py.File(path, "a") as file:
        del file["ids"], file["moving_probability"]
    report = evaluate_predictions(path, truth)
    for name in ("iou", "event_iou", "clutter", "object_aee", "iou_all_frames"):
        assert report.value(MODEL, name) is None
    for name in ("abs_rel", "camera_rre", "camera_aee_depth"):
        assert report.value(MODEL, name) == before.value(MODEL, name) is not None
    save_estimates(tmp_path / "half" / "estimates.h5", all_ids)
    with h5py.File(tmp_path / "half" / "estimates.h5", "a") as file:
        del file["ids"]
    with pytest.raises(BadFile, match="lacks `ids`"):
        evaluate_predictions(tmp_path / "half" / "estimates.h5", truth)
