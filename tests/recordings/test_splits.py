"""The published splits, against what the datasets' pages and papers say of them."""

from pathlib import Path

import pytest
from tests.recordings.dataset_files import v1_bag, v1_npz, v1_text, v2_folder, v2_npz

from evimo.errors import BadInput, NotFound
from evimo.recordings.finding import recordings_in
from evimo.recordings.layouts import found_layout
from evimo.recordings.splits import part_of_split, place_of, splits


def test_the_papers_split_trains_on_box_and_floor_and_never_tests_on_what_it_trains_on():
    assert set(splits()["paper2019"]["train"]) == {"train/box", "train/floor"}
    assert {"eval/table", "eval/wall", "eval/fast"} <= set(splits()["paper2019"]["test"])
    for parts in splits().values():
        assert not set(parts["train"]) & set(parts["test"])


@pytest.mark.parametrize(
    ("name", "train", "test"),
    [("imo", 21, 8), ("imo_ll", 3, 2), ("sfm", 52, 10), ("sfm_ll", 5, 6), ("sanity", 0, 31), ("sanity_ll", 0, 35)],
)
def test_evimo2_has_as_many_sequences_as_its_page_says(name, train, test):
    parts = splits()[f"evimo2-{name}"]
    assert (len(set(parts["train"])), len(set(parts["test"]))) == (train, test)


def test_new_scenes_are_not_seen_in_training():
    scenes = {part: {name.split("_")[0] for name in names} for part, names in splits()["evimo2-new-scenes"].items()}
    assert scenes == {
        "train": {"scene6", "scene9", "scene10"},
        "test": {"scene12", "scene13", "scene14", "scene15"},
    }


def test_places_are_read_from_folders():
    box = place_of(Path("/data/EV-IMO/train/box/npz/seq_01.npz"))
    assert (box.folder, box.group, box.camera) == ("train", "box", "")
    two = place_of(Path("/d/left_camera/sfm/eval/scene_03_00_000000"))
    assert (two.sequence, two.folder, two.group, two.camera) == ("scene_03_00_000000", "eval", "sfm", "left_camera")
    assert place_of(Path("/d/replica/test/fast/seq_00")).folder == "eval"
    assert place_of(Path("/tmp/film.npz")).group == ""


def test_parts_are_chosen_by_folder_or_by_name():
    paths = [Path(f"/d/{folder}/{name}/npz/seq_00.npz") for folder in ("train", "eval") for name in ("box", "table")]
    assert part_of_split(paths, "paper2019", "train") == paths[:1]
    assert part_of_split(paths, "paper2019", "test") == paths[2:]
    names = [Path(f"/d/left_camera/imo/eval/{name}") for name in ("scene13_dyn_test_00_000000", "own")]
    assert part_of_split(names, "evimo2-imo", "test") == names[:1]
    with pytest.raises(NotFound, match="train part of evimo2-imo"):
        part_of_split(names, "evimo2-imo", "train")
    with pytest.raises(BadInput, match=r"no split 'paper'[\s\S]*paper2019"):
        part_of_split(names, "paper", "train")


def test_one_finder_finds_every_layout_with_maps(tmp_path):
    made = [
        v1_npz(tmp_path / "train" / "box" / "npz" / "seq_00.npz"),
        v1_text(tmp_path / "eval" / "wall" / "txt" / "seq_00"),
        v2_npz(tmp_path / "left_camera" / "imo" / "eval" / "scene13_dyn_test_00_000000.npz"),
        v2_folder(tmp_path / "left_camera" / "imo" / "train" / "scene6_dyn_train_03_000000"),
    ]
    bag = v1_bag(tmp_path / "raw" / "seq_00")
    assert set(recordings_in([tmp_path])) == set(made)
    assert recordings_in([tmp_path], split="paper2019") == [made[1]]
    assert recordings_in([tmp_path], split="evimo2-imo", part="train") == [made[3]]
    assert found_layout(bag) == "EV-IMO bag"
    with pytest.raises(NotFound):
        recordings_in([bag])
