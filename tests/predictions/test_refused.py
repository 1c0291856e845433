"""Predictions that do not fit the recording, or can be read in two ways, are one error."""

import os
from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest

from evimo.cli import main
from evimo.errors import BadFile, BadInput, EvimoError, EvimoWarning, NotFound
from evimo.evaluation.report import MODEL
from evimo.streaming.evaluating_predictions import evaluate_predictions

CENTRES_US = np.array([12_500 + 25_000 * k for k in range(6)])
PERFECT_MASKS = (
    *("iou", "iou_30px", "iou_pooled", "iou_all_frames", "iou_best30", "iou_classes", "event_iou", "event_iou_frames"),
    *("event_iou_own", "iou_event_pixels", "iou_hulls", "detected", "detected_box", "detected_box_iou"),
    *("detected_region", "detected_mask", "instance_iou", "instance_iou_matched", "ap", "ap50"),
)
PERFECT_LABELS = ("event_iou", "event_iou_frames", "event_iou_own", "iou_event_pixels", "iou_hulls")
NO_PREDICTION = "slices WITHOUT a prediction, not scored"


def refused(path: Path, truth: Path, error: type[EvimoError], words: str) -> None:
    with pytest.raises(error, match=words):
        evaluate_predictions(path, truth)


def test_predictions_of_another_recording_are_warned_of(save_estimates, truth, all_ids, tmp_path):
    with pytest.warns(EvimoWarning, match="of 'b'"):
        evaluate_predictions(save_estimates(tmp_path / "run" / "estimates.h5", all_ids, recording="b"), truth)


def test_maps_of_another_sensor_are_refused(save_pictures, save_estimates, truth, all_ids, tmp_path):
    np.savez(tmp_path / "wide.npz", masks=np.zeros((6, 30, 41), bool), times=CENTRES_US)
    refused(tmp_path / "wide.npz", truth, BadInput, "30 x 41")
    refused(save_pictures(tmp_path / "png", all_ids[:, 1:]), truth, BadInput, "29 x 40")
    refused(save_estimates(tmp_path / "estimates.h5", all_ids[:, :, 1:]), truth, BadInput, "30 x 39")


@pytest.mark.parametrize(
    ("times", "error", "words"),
    [
        (CENTRES_US + 5_000, BadInput, "no mask in .* 5000 µs apart"),
        (np.arange(6), BadInput, "12495 µs apart"),
        (CENTRES_US * 1e-3, BadInput, "no mask"),  # in ms
        (CENTRES_US[::-1], BadFile, "do not ascend"),
        (CENTRES_US[:5], BadFile, "6 maps and 5 times"),
        (np.full(6, np.nan), BadFile, "no times"),
        (np.zeros((6, 2)), BadFile, "no times"),
    ],
)
def test_times_that_fit_no_slice_are_refused(truth, all_ids, tmp_path, times, error, words):
    np.savez(tmp_path / "ids.npz", ids=all_ids, times=times)
    refused(tmp_path / "ids.npz", truth, error, words)


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        ({"ids": np.zeros((6, 30, 40), int)}, "lacks `times`"),
        ({"ids": np.zeros((6, 30, 40)), "times": CENTRES_US}, "float64"),
        ({"ids": np.full((6, 30, 40), 2**32 + 1), "times": CENTRES_US}, "go beyond 2,147,483,647"),
        ({"masks": np.full((6, 30, 40), 1.5), "times": CENTRES_US}, "outside 0 to 1"),
        ({"masks": np.full((6, 30, 40), np.nan), "times": CENTRES_US}, "outside 0 to 1"),
        ({"masks": np.zeros((30, 40), bool), "times": CENTRES_US}, "`masks` of"),
        ({"other": np.zeros(3)}, "neither masks, nor ids, nor labels: other"),
        ({"labels": np.zeros(7200), "t": np.zeros(7200), "x": np.zeros(7200), "y": np.zeros(7199)}, "not one length"),
        ({"labels": np.full(7200, 0.5)}, "no whole numbers"),
        ({"ids": np.array([{}]), "times": CENTRES_US}, "pickle"),
    ],
)
def test_archives_that_hold_no_predictions_are_refused(truth, tmp_path, arrays, words):
    np.savez(tmp_path / "bad.npz", **arrays)
    refused(tmp_path / "bad.npz", truth, BadFile, words)


def test_labels_of_other_events_are_refused(save_labels, truth, labelled_rows, tmp_path):
    np.savez(tmp_path / "few.npz", labels=labelled_rows[1:, 3])
    refused(tmp_path / "few.npz", truth, BadInput, "7,199 labels, the recording 7,200 events")
    np.savetxt(tmp_path / "few.csv", labelled_rows[1:, 3], fmt="%d")
    refused(tmp_path / "few.csv", truth, BadInput, "fewer labels")
    np.savetxt(tmp_path / "many.csv", np.append(labelled_rows[:, 3], 0), fmt="%d")
    refused(tmp_path / "many.csv", truth, BadInput, "more labels")
    moved = labelled_rows + [0, 1, 0, 0]
    refused(save_labels(tmp_path / "outside.csv", moved), truth, BadInput, "column 40")
    later = labelled_rows + [1, 0, 0, 0]
    refused(save_labels(tmp_path / "later.csv", later), truth, BadInput, "does not have")
    refused(save_labels(tmp_path / "back.csv", labelled_rows[::-1]), truth, BadFile, "go back")
    beyond = np.concatenate((labelled_rows, [[900_000, 0, 0, 1]]))
    refused(save_labels(tmp_path / "beyond.csv", beyond), truth, BadInput, "after the recording's end")
    refused(save_labels(tmp_path / "none.csv", labelled_rows, "t,x,y,p"), truth, BadFile, "no labels of events")
    (tmp_path / "words.csv").write_text("label\n1\nseven\n")
    refused(tmp_path / "words.csv", truth, BadFile, "no label")


def test_damaged_and_missing_files_are_one_error(save_pictures, save_estimates, truth, all_ids, tmp_path, capsys):
    refused(tmp_path / "nowhere", truth, NotFound, "no predictions")
    (tmp_path / "empty").mkdir()
    refused(tmp_path / "empty", truth, BadFile, "holds no predictions")
    path = save_estimates(tmp_path / "estimates.h5", all_ids)
    path.write_bytes(path.read_bytes()[:3000])
    refused(path, truth, BadFile, "HDF5")
    pictures = save_pictures(tmp_path / "png", all_ids)
    (pictures / f"{CENTRES_US[2]:012d}.png").write_bytes(b"\x89PNG")
    refused(pictures, truth, BadFile, f"{CENTRES_US[2]}.png is no PNG")
    np.savez(tmp_path / "cut.npz", ids=all_ids, times=CENTRES_US)
    (tmp_path / "cut.npz").write_bytes((tmp_path / "cut.npz").read_bytes()[:3000])
    refused(tmp_path / "cut.npz", truth, BadFile, "cut.npz")
    (tmp_path / "text.md").write_text("no")
    assert main(["evaluate", str(tmp_path / "text.md"), "--truth", str(truth)]) == 2
    assert "no kind of predictions" in capsys.readouterr().err


def test_pictures_that_are_no_masks_are_refused(save_pictures, truth, all_ids, tmp_path):
    rng = np.random.default_rng(0)
    refused(
        save_pictures(tmp_path / "soft", rng.integers(0, 255, all_ids.shape, np.uint8)), truth, BadFile, "different"
    )
    refused(save_pictures(tmp_path / "rgb", rng.integers(0, 3, (6, 30, 40, 3), np.uint8)), truth, BadFile, "colours")
    grey = save_pictures(tmp_path / "grey", np.repeat(all_ids[..., None], 3, axis=3))
    assert evaluate_predictions(grey, truth).value(MODEL, "iou") == 1
    (grey / "last.png").write_bytes(b"")
    refused(grey, truth, BadFile, "what time")


@pytest.mark.parametrize(
    "options",
    [["--model", "tiny"], ["--imu", "off"], ["--within-ms", "20"], ["--within-ms", "-1"], ["--within-ms", "nan"]],
)
def test_options_that_do_not_go_with_predictions_are_refused(truth, all_ids, tmp_path, capsys, options):
    np.savez(tmp_path / "ids.npz", ids=all_ids, times=CENTRES_US)
    assert main(["evaluate", str(tmp_path / "ids.npz"), "--truth", str(truth), *options]) == 2
    assert "try:" in capsys.readouterr().err
    assert main(["evaluate", str(truth), "--within-ms", "2"]) == 2
    assert main(["evaluate", str(truth), str(truth), "--truth", str(truth)]) == 2


def test_masks_that_could_be_probabilities_are_refused_rather_than_guessed(save_pictures, truth, all_ids, tmp_path):
    np.savez(tmp_path / "soft.npz", masks=(all_ids * 100).astype(np.uint8), times=CENTRES_US)
    refused(tmp_path / "soft.npz", truth, BadFile, "more values than 0 and one other")
    refused(save_pictures(tmp_path / "border", np.where(all_ids == 1, 255, all_ids)), truth, BadFile, "255 beside")
    np.savez(tmp_path / "hard.npz", masks=(all_ids > 0) * np.uint8(255), times=CENTRES_US)
    assert evaluate_predictions(tmp_path / "hard.npz", truth).value(MODEL, "iou") == 1
    full = np.full_like(all_ids, 255)
    assert evaluate_predictions(save_pictures(tmp_path / "full", full), truth).value(MODEL, "recall") == 1


@pytest.mark.parametrize(
    ("name", "values", "words"),
    [
        ("moving_probability", np.zeros((6, 30, 40)), "another type"),  # 0 to 1 would all be below one half of 255
        ("ego", np.zeros((6, 3)), "fit together"),
        ("ego", np.full((6, 6), np.nan), "not finite"),
        ("rel_depth", np.full((6, 30, 40), np.inf, np.float16), "not finite"),
        ("t_us", np.int64(3), "no times"),
        ("ids", np.zeros((5, 30, 40), np.uint8), "fit together"),
        ("valid", None, "lacks `valid`"),
        ("has_events", np.ones(5, bool), "fit together"),
    ],
)
def test_estimates_with_impossible_datasets_are_refused(save_estimates, truth, all_ids, tmp_path, name, values, words):
    path = save_estimates(tmp_path / "estimates.h5", all_ids)
    with h5py.File(path, "a") as file:
        del file[name]
        if values is not None:
            file[name] = values
    refused(path, truth, BadFile, words)


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ("frame_0.png,12500\nframe_9.png,900000", "frame_9.png"),
        ("frame_0.png,soon", "not name,time"),
        ("frame_0.png,1,2", "not name,time"),
        ("time,name", "lists no picture"),
    ],
)
def test_a_list_of_times_that_does_not_fit_the_pictures_is_refused(truth, all_ids, tmp_path, lines, words):
    (tmp_path / "png").mkdir()
    cv2.imwrite(str(tmp_path / "png" / "frame_0.png"), all_ids[0])
    (tmp_path / "png" / "times.csv").write_text(lines)
    refused(tmp_path / "png", truth, BadFile, words)


def test_a_picture_that_says_it_is_huge_takes_no_memory(save_pictures, truth, all_ids, tmp_path, monkeypatch):
    pictures = save_pictures(tmp_path / "png", all_ids)
    path = pictures / f"{CENTRES_US[0]:012d}.png"
    content = bytearray(path.read_bytes())
    content[16:24] = (30_000).to_bytes(4, "big") * 2
    path.write_bytes(content)
    monkeypatch.setattr(cv2, "imread", lambda *_: pytest.fail("it was decoded"))
    refused(pictures, truth, BadInput, "30000 x 30000")


def test_a_list_of_times_that_is_no_text_is_one_error(save_pictures, truth, all_ids, tmp_path):
    pictures = save_pictures(tmp_path / "png", all_ids)
    (pictures / "times.csv").write_bytes(b"a.png,\xff\xfe\n")
    refused(pictures, truth, BadFile, "not name,time")


PARTS = {
    "attributes": (h5py.AttributeManager, "__iter__"),
    "a dataset": (h5py.Group, "get"),
    "a name": (h5py.Group, "__contains__"),
}


@pytest.mark.parametrize("part", PARTS.values(), ids=list(PARTS))
def test_hdf5_that_breaks_inside_is_one_error(save_estimates, truth, all_ids, tmp_path, monkeypatch, part):
    (tmp_path / "run").mkdir()
    path = save_estimates(tmp_path / "run" / "estimates.h5", all_ids)

    def broken(*_):
        raise RuntimeError("bad heap signature")

    monkeypatch.setattr(*part, broken)
    refused(path.parent, truth, BadFile, "is damaged: bad heap signature")
    refused(path, truth, BadFile, "is damaged: bad heap signature")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are named pipes")
def test_pipes_are_refused_rather_than_waited_for(truth, tmp_path):
    for name in ("pipe.csv", "pipe.h5", "pictures/000012500.png"):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        os.mkfifo(path)
    refused(tmp_path / "pipe.csv", truth, BadFile, "is a pipe or a device")
    refused(tmp_path / "pipe.h5", truth, BadFile, "is a pipe or a device")
    refused(Path(os.devnull), truth, BadFile, "is a pipe or a device")
    refused(tmp_path / "pictures", truth, BadFile, "holds no predictions")
