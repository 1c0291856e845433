"""Slices of a dataset's own files as a torch Dataset, against the scene that they were made from."""

import numpy as np
import pytest
import torch
from tests.recordings.dataset_files import all_events, v1_npz, v2_folder
from tests.recordings.known_scene import CAMERA, truth
from torch.utils.data import DataLoader

from evimo.errors import BadInput
from evimo.geometry.rectification import rectified
from evimo.training.data import samples_of
from evimo.training.slice_dataset import SliceDataset, collated


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    root = tmp_path_factory.mktemp("data")
    v1_npz(root / "train" / "box" / "npz" / "seq_00.npz")
    v2_folder(root / "left_camera" / "imo" / "train" / "scene6_dyn_train_03_000000", unknown=(9, 10, 11))
    return root


def test_slices_hold_the_scenes_truth_at_their_centres(folder):
    data = SliceDataset(folder / "train")
    assert len(data) == 18  # from the slice of 0.2 s to that of 0.625 s
    lens = rectified(CAMERA)
    for place in (0, 9, 17):
        sample, centre_us = data[place], 212_500 + 25_000 * place
        scene = truth(centre_us)
        ids = lens.from_sensor(scene.ids)
        assert np.mean(sample.ids[0].numpy() != ids) < 0.02
        known = sample.depth_valid[0].numpy() & (sample.ids[0].numpy() == ids)
        expected = lens.from_sensor(scene.depth)
        np.testing.assert_allclose(sample.depth[0].numpy()[known], expected[known], rtol=0.02)
        np.testing.assert_allclose(sample.ego, scene.ego, atol=2e-3)
        assert torch.equal(sample.moving, (sample.ids > 0) & (sample.ids < 3))
        written = all_events().between(centre_us - 12_500, centre_us + 12_500)
        assert len(sample.events) <= len(written)
        assert sample.events[:, 2].abs().max() <= 0.0125
        assert set(sample.events[:, 3].tolist()) == {-1.0, 1.0}


def test_slices_of_a_gap_are_no_samples_and_stand_between_their_neighbours(folder):
    data = SliceDataset(folder / "left_camera")
    middles = data._recording(0).middles()
    assert len(data) == len(middles) == 18 - 2
    assert 9 not in middles
    assert len(data._recording(0)) == 18
    assert len(samples_of([data._recording(0)])) == len(middles)


def test_batches_come_from_workers_and_hold_each_samples_events(folder):
    data = SliceDataset(folder, split="paper2019")
    (batch, *_) = DataLoader(data, batch_size=3, collate_fn=collated, num_workers=1)
    assert batch.depth.shape[0] == batch.ego.shape[0] == 3
    assert batch.events.shape[1] == 5
    for place in range(3):
        torch.testing.assert_close(batch.events[batch.events[:, 0] == place, 1:], data[place].events)


def test_cameras_of_different_sizes_do_not_share_a_batch(folder):
    one = SliceDataset(folder)[0]
    other = one._replace(depth=one.depth[:, 1:])
    with pytest.raises(BadInput, match="different sizes"):
        collated([one, other])
