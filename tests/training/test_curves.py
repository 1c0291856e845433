import csv
import sys

import numpy as np
import pytest

from evimo.errors import BadInput
from evimo.training.validation import validated

pytest.importorskip("tensorboard", reason="TensorBoard is not installed: it comes with evimo[train]")


def test_a_name_that_is_no_utf8_is_refused_before_tensorboard_sees_it(curves, tmp_path):
    with pytest.raises(BadInput, match="is not UTF-8"), curves.open_curves(tmp_path / "K\udcfcche", [], step=0):
        pass
    assert not list(tmp_path.iterdir())


@pytest.fixture
def curves():
    from evimo.training import curves

    return curves


def shown(folder):
    """Scalars by name as (step, value), and the sizes of pictures by name, as TensorBoard reads them."""
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    read = EventAccumulator(str(folder))
    read.Reload()
    scalars = {tag: [(each.step, each.value) for each in read.Scalars(tag)] for tag in read.Tags()["scalars"]}
    images = {tag: [(each.height, each.width) for each in read.Images(tag)] for tag in read.Tags()["images"]}
    return scalars, images


def test_losses_scores_and_pictures_are_left(curves, recording, without_events, tiny, tmp_path):
    worlds = [recording(size=(64, 64)), without_events(recording()), recording(slices=3)]  # one can be scored
    model = tiny().eval()
    with curves.open_curves(tmp_path, worlds, step=0) as these:
        these.learned(1, {"loss": 2.5})
        these.validate(1, model)
    scalars, images = shown(tmp_path / "tensorboard")
    assert scalars["loss/loss"] == [(1, 2.5)]
    scores = validated(model, worlds[:1])
    assert scalars["validation/event_iou"][0][1] == pytest.approx(scores["event_iou"])
    assert images == {"masks/0": [(32, 96)]}
    with (tmp_path / "validation.csv").open() as file:
        (row,) = csv.DictReader(file)
    assert float(row["event_iou"]) == pytest.approx(scores["event_iou"], rel=1e-3)


def test_recordings_that_cannot_be_scored_are_refused(curves, recording, without_events, tmp_path):
    worlds = [without_events(recording()), recording(slices=4)]
    with pytest.raises(BadInput, match="no recording to validate on"), curves.open_curves(tmp_path, worlds, step=0):
        pass


def test_a_run_that_was_killed_draws_its_later_steps_anew(curves, tmp_path):
    for begin, values in ((0, (5, 4, 3)), (1, (2, 1))):
        with curves.open_curves(tmp_path, [], step=begin) as these:
            for step, value in enumerate(values, begin + 1):
                these.learned(step, {"loss": value})
    assert shown(tmp_path / "tensorboard")[0]["loss/loss"] == [(1, 5), (2, 2), (3, 1)]
    assert len((tmp_path / "log.csv").read_text().splitlines()) == 4


def test_a_picture_shows_events_truth_and_what_is_called(curves, recording, tiny):
    world = recording(size=(64, 64))
    events, true, called = np.split(curves.picture(tiny().eval(), world)[0], 3, axis=1)
    np.testing.assert_array_equal(true > 0, world.moving[3][1::2, 1::2])
    assert 0.1 < (events > 0).mean() < 1
    assert set(np.unique(called)) <= {0, 255}


@pytest.mark.skipif(sys.platform == "win32", reason="no limits of files there")
@pytest.mark.parametrize("begun", [False, True])
def test_a_full_disk_is_one_error_without_a_traceback(begun, curves, tmp_path, capsys):
    """A limit of the size of files stands for the disk; `log.csv` is full first where a run goes on."""
    import resource

    if begun:
        (tmp_path / "log.csv").write_text("step,loss\n" + "1,2.5\n" * 1000)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (7000, before[1]))
    try:
        with (
            pytest.raises(BadInput, match=f"cannot write {tmp_path}/(tensorboard|log.csv): File too large"),
            curves.open_curves(tmp_path, [], step=1) as these,
        ):
            for step in range(2, 100_000):
                these.learned(step, {"loss": 2.5})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert capsys.readouterr().err == ""


def test_of_a_network_without_masks_a_picture_shows_what_is_near(curves, recording, ecn):
    world = recording(size=(64, 64))
    _, true, said = np.split(curves.picture(ecn().eval(), world)[0], 3, axis=1)
    box = world.moving[3][1::2, 1::2]
    assert true[box].min() > true[~box].max() > 0  # the box is nearer than the wall
    assert said.min() > 0 and np.ptp(said.astype(int)) > 0
