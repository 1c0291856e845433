"""A plan says all of a recording, and the recording says its plan."""

import json
from dataclasses import fields, replace

import cv2
import numpy as np
import pytest

from evimo.errors import BadInput
from evimo.geometry.camera import Camera
from evimo.recordings.recording import open_recording
from evimo.recordings.writer import RecordingWriter
from evimo.simulate.own_folders import OWN, OwnFolders
from evimo.simulate.plan import RecordingPlan, told_plan
from evimo.simulate.resuming import NAMED, check_made_alike

PLAN = RecordingPlan(seed=7, set_number=2, seconds=0.05, size=(33, 44))
OTHERS = {
    "seconds": 0.025,
    "camera": "evimo",
    "sensor": "samsung",
    "size": (34, 44),
    "part": "test",
    "room": "wall",
    "own": OWN,
    "device": "cuda",
    "population": "replica",
}


def kept(plan, folder, camera):
    """A recording of nothing that tells of a plan."""
    with RecordingWriter(folder, camera, facts=plan.facts()):
        pass
    return folder


@pytest.fixture
def camera():
    return Camera(fx=40.0, fy=40.0, cx=21.5, cy=16.0, height=33, width=44)


def test_every_choice_is_known_here():
    """A field that is added to the plan must be told by recordings and looked at where they are gone on with."""
    names = {field.name for field in fields(RecordingPlan)}
    assert names - set(NAMED) == OTHERS.keys()
    assert told_plan({}).keys() == names - {"own"}


def test_a_recording_tells_the_whole_plan(tmp_path, camera):
    plan = replace(PLAN, **{name: value for name, value in OTHERS.items() if name != "size"})
    told = open_recording(kept(plan, tmp_path / "a", camera)).meta
    assert RecordingPlan(**told_plan(told)) == replace(plan, size=(33, 44))
    assert json.loads(json.dumps(told)) == told


def test_what_no_choice_was_made_of_is_not_told(tmp_path, camera):
    told = open_recording(kept(PLAN, tmp_path / "a", camera)).meta
    assert not told.keys() & {"part", "room", "population", "textures", "meshes"}
    assert RecordingPlan(**told_plan(told)) == PLAN


@pytest.mark.parametrize("name", sorted(OTHERS.keys() - {"own"}))
def test_a_recording_that_was_made_otherwise_in_one_thing_is_refused(name, tmp_path, camera):
    path = kept(PLAN, tmp_path / "a", camera)
    check_made_alike([path], replace(PLAN, seed=8))
    with pytest.raises(BadInput, match=rf"made with {name} \S+ instead of {name}"):
        check_made_alike([path], replace(PLAN, **{name: OTHERS[name]}))


def test_folders_of_the_users_own_are_compared_by_content(tmp_path, camera):
    folders = []
    for name, shade in (("one", 10), ("same", 10), ("other", 200)):
        (tmp_path / name).mkdir()
        cv2.imwrite(str(tmp_path / name / "a.png"), np.full((64, 64, 3), shade, np.uint8))
        folders.append(OwnFolders(textures=tmp_path / name))
    path = kept(replace(PLAN, own=folders[0]), tmp_path / "a", camera)
    check_made_alike([path], replace(PLAN, own=folders[1]))
    for other in (folders[2], OWN):
        with pytest.raises(BadInput, match=r"textures of sha256 .* instead of textures"):
            check_made_alike([path], replace(PLAN, own=other))


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ({"seed": -1}, "from 0"),
        ({"set_number": 7}, "1 to 6"),
        ({"seconds": 0.01}, "multiple of 0.025"),
        ({"seconds": float("nan")}, "multiple of 0.025"),
        ({"seconds": float("inf")}, "multiple of 0.025"),
        ({"size": (15, 44)}, "16x16"),
        ({"sensor": "kodak"}, "davis346"),
        ({"part": "eval"}, "train, test"),
        ({"room": "sea"}, r"floor|wall"),
        ({"population": "easy"}, "stress, replica"),
    ],
)
def test_impossible_plans_are_refused(how, message):
    with pytest.raises(BadInput, match=message):
        replace(PLAN, **how)
