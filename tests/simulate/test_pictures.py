"""Pictures rendered again, against the events that the first ones made."""

import json
from dataclasses import replace
from importlib import metadata

import numpy as np
import pytest

from evimo.recordings.recording import open_recording
from evimo.simulate.dataset import DatasetPlan, write_recording
from evimo.simulate.pictures import pictures
from evimo.simulate.plan import RecordingPlan

PLAN = DatasetPlan(first=RecordingPlan(seed=8, set_number=3, seconds=0.1, size=(48, 64)), minutes=1)


@pytest.mark.slow
def test_pictures_made_again_change_where_events_say_so(tmp_path):
    """Pixels that got ON events became brighter, those with OFF events darker: the pictures are of this recording."""
    made = open_recording(write_recording(PLAN, tmp_path, 8))
    light = pictures(made)
    assert light is not None
    change = np.log(light(62_500) + 0.05) - np.log(light(37_500) + 0.05)
    balance = np.zeros(made.camera.size)
    for packet in made.events.packets(37_500, 62_500):
        np.add.at(balance, (packet.y, packet.x), packet.p)
    strong = np.abs(balance) >= 2
    assert strong.sum() > 200
    assert (np.sign(change) == np.sign(balance))[strong].mean() > 0.9


def test_pictures_are_of_this_very_recording_or_there_are_none(tmp_path):
    first = replace(PLAN.first, seconds=0.05, size=(33, 44), sensor="samsung")
    plan = replace(PLAN, first=first)
    folder = write_recording(plan, tmp_path, 7)
    path = folder / "dataset_info.json"
    stored = json.loads(path.read_text())
    light = pictures(open_recording(folder))
    assert light is not None
    assert light(12_500).shape == (33, 44)

    def told(**facts):
        path.write_text(json.dumps(stored | {"evimo": stored["evimo"] | facts}))
        return pictures(open_recording(folder))

    assert told(version=metadata.version("evimo") + ".later") is None
    assert told(seed=8) is None
    assert told(camera_kind="evimo") is None
    assert told(set=17) is None
