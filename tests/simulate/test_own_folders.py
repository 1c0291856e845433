"""A user's own textures and meshes: what recordings tell of them, and what happens when they change."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from evimo.errors import BadFile, BadInput, EvimoWarning, NotFound
from evimo.jobs.crew import Crew
from evimo.recordings.facts import facts_of
from evimo.recordings.recording import open_recording
from evimo.simulate.dataset import DatasetPlan, simulate_dataset, write_recording
from evimo.simulate.own_folders import OwnFolders, forget, own_folders_of
from evimo.simulate.pictures import pictures
from evimo.simulate.plan import RecordingPlan
from evimo.simulate.replica import SEQUENCES, ReplicaPlan, simulate_replica

FIRST = RecordingPlan(seed=0, set_number=5, seconds=0.05, size=(33, 44))
PLAN = DatasetPlan(first=FIRST, minutes=0.05 / 60)


def of(plan, **how):
    """The plan with other recordings."""
    return replace(plan, first=replace(plan.first, **how))


TENT = "v 0 0 0\nv 4 0 0\nv 0 2 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.fixture
def folders(tmp_path):
    """Two pictures and two meshes."""
    rng = np.random.default_rng(0)
    for name in ("textures", "meshes"):
        (tmp_path / name).mkdir()
    for k in range(2):
        assert cv2.imwrite(str(tmp_path / f"textures/{k}.png"), rng.integers(0, 255, (64, 48), np.uint8))
        (tmp_path / f"meshes/{k}.obj").write_text(TENT.replace("v 4", f"v {4 + k}"))
    return OwnFolders(tmp_path / "textures", tmp_path / "meshes")


def files_of(folder):
    return {file.name: file.read_bytes() for file in folder.iterdir() if file.suffix != ".json"}


def test_own_files_change_a_recording_and_the_same_files_elsewhere_make_it_again(folders, tmp_path):
    seen = [files_of(write_recording(PLAN, tmp_path / "plain", 0))]
    for k, own in enumerate((OwnFolders(meshes=folders.meshes), folders)):
        seen.append(files_of(write_recording(of(PLAN, own=own), tmp_path / f"own{k}", 0)))
        assert seen[-1] not in seen[:-1]
    folders.meshes.rename(tmp_path / "moved")
    moved = replace(folders, meshes=tmp_path / "moved")
    assert files_of(write_recording(of(PLAN, own=moved), tmp_path / "again", 0)) == seen[-1]


def test_a_recording_tells_its_folders_and_its_pictures_are_rendered_with_them(folders, tmp_path):
    folder = write_recording(of(PLAN, own=folders), tmp_path / "out", 0)
    facts = facts_of(folder)
    assert facts["textures"]["folder"] == str(folders.textures.resolve())
    assert len({facts[name]["sha256"] for name in ("textures", "meshes")}) == 2
    assert own_folders_of(facts) == folders
    light = pictures(open_recording(folder))
    assert light is not None and light(12_500).shape == (33, 44)
    assert not {"textures", "meshes"} & set(facts_of(write_recording(PLAN, tmp_path / "plain", 0)))


def test_pictures_of_folders_that_changed_or_went_are_refused(folders, tmp_path):
    recording = open_recording(write_recording(of(PLAN, own=folders), tmp_path / "out", 0))
    copy = tmp_path / "textures2"
    (tmp_path / "textures").rename(copy)
    forget()
    with pytest.raises(NotFound, match="textures"):
        pictures(recording)
    copy.rename(tmp_path / "textures")
    assert pictures(recording) is not None
    with (folders.meshes / "0.obj").open("a") as file:
        file.write("# changed\n")
    forget()
    with pytest.raises(NotFound, match=r"the meshes in .* are others than they were"):
        pictures(recording)


def test_going_on_with_other_folders_is_refused(folders, tmp_path):
    plan = of(PLAN, own=folders)
    made = list(simulate_dataset(plan, tmp_path / "out"))
    assert list(simulate_dataset(plan, tmp_path / "out")) == made
    for other in (OwnFolders(folders.textures), OwnFolders()):
        with pytest.raises(BadInput, match=r"is there already, made with .* of sha256"):
            list(simulate_dataset(of(plan, own=other), tmp_path / "out"))


@pytest.mark.slow
def test_workers_make_the_same_recordings(folders, tmp_path):
    plan = of(replace(PLAN, minutes=0.1 / 60), own=folders)
    for workers in (1, 2):
        assert len(list(simulate_dataset(plan, tmp_path / str(workers), crew=Crew(workers=workers)))) == 2
    for k in range(2):
        one, two = (tmp_path / str(workers) / f"set5_{k:06d}" for workers in (1, 2))
        assert files_of(one) == files_of(two)


def test_a_replica_tells_its_folders_in_its_index_and_refuses_others(folders, tmp_path):
    plan = ReplicaPlan(minutes=SEQUENCES * 0.025 / 60, size=(24, 32), own=folders)
    next(iter(simulate_replica(plan, tmp_path)))
    index = json.loads((tmp_path / "replica.json").read_text())
    assert {"textures", "meshes"} < set(index) and len(index["meshes"]) == 64
    with pytest.raises(BadInput, match="another plan"):
        next(iter(simulate_replica(replace(plan, own=OwnFolders()), tmp_path)))


def test_strangers_are_counted_and_damaged_files_stop_before_anything_is_written(folders, tmp_path):
    (folders.textures / "notes.txt").write_text("?")
    plan = of(PLAN, own=folders)
    with pytest.warns(EvimoWarning, match=r"1 of 3 files in .* are no pictures"):
        next(iter(simulate_dataset(plan, tmp_path / "out")))
    (folders.textures / "notes.txt").unlink()
    for broken, name in ((folders.meshes, "2.stl"), (folders.textures, "3.png")):
        (broken / name).write_bytes(b"rubbish")
        forget()
        with pytest.raises(BadFile, match=name):
            next(iter(simulate_dataset(of(PLAN, own=folders), tmp_path / "new")))
        assert not (tmp_path / "new").exists()
        (broken / name).unlink()
    for empty in (OwnFolders(tmp_path / "none"), OwnFolders(meshes=folders.textures)):
        with pytest.raises(NotFound, match="try: a folder with"):
            next(iter(simulate_dataset(of(PLAN, own=empty), tmp_path / "new")))
