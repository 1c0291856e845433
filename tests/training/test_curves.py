import csv

import numpy as np
import pytest

from evimo.training.validation import validated

pytest.importorskip("tensorboard", reason="TensorBoard is not installed: it comes with evimo[train]")


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
