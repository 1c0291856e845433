"""A replica of EV-IMO: its plan, its split, and a tiny one from the command line."""

import json
from collections import Counter
from dataclasses import replace

import pytest

from evimo.cli import main
from evimo.cli.simulate import simulate
from evimo.errors import BadInput
from evimo.recordings.recording import open_recording
from evimo.scene.drawing.scenes import SETS
from evimo.scene.drawing.toys import KINDS, UNSEEN
from evimo.scene.textures.patterns import SIZE
from evimo.simulate.cameras import EVIMO
from evimo.simulate.dataset import DatasetPlan, simulate_dataset
from evimo.simulate.plan import RecordingPlan
from evimo.simulate.recording import simulate_recording
from evimo.simulate.replica import INDEX, ReplicaPlan, simulate_replica

TINY = ReplicaPlan(minutes=2 / 60, seed=5, size=(24, 32))


@pytest.fixture(scope="module")
def drawn():
    """The recordings of a short replica, not filmed."""
    return [
        (
            sequence,
            simulate_recording(
                RecordingPlan(
                    seed=sequence.seed,
                    set_number=sequence.set,
                    seconds=sequence.seconds,
                    camera="evimo",
                    size=(24, 32),
                    part=sequence.part,
                    room=sequence.room,
                    population="replica",
                )
            ),
        )
        for sequence in TINY.sequences
    ]


def test_a_replica_is_as_large_as_the_paper_says():
    sequences = ReplicaPlan().sequences
    sets = Counter(sequence.set for sequence in sequences)
    assert len(sequences) > 30
    assert sum(sequence.seconds for sequence in sequences) == pytest.approx(32 * 60, abs=0.0125)
    assert sets.keys() == SETS.keys()
    assert min(sets.values()) == 3
    assert max(sets.values()) <= 19
    assert len({sequence.path for sequence in sequences}) == len({sequence.seed for sequence in sequences}) == 51


@pytest.mark.parametrize("minutes", [2 / 60, 0.1, 1, 5.3])
def test_minutes_scale_it(minutes):
    sequences = ReplicaPlan(minutes=minutes).sequences
    seconds = {sequence.seconds for sequence in sequences}
    assert len(sequences) == 51
    assert sum(sequence.seconds for sequence in sequences) == pytest.approx(minutes * 60, abs=0.0126)
    assert max(seconds) - min(seconds) < 0.026


def test_the_split_is_the_papers():
    split = {part: {s.background for s in TINY.sequences if s.part == part} for part in ("train", "test")}
    assert split["train"] == {"box", "floor"}
    assert split["test"] == {"table", "wall", "fast", "box", "tabletop"}
    assert {s.set for s in TINY.sequences if s.background == "fast"} == {6}
    assert all(s.path.startswith(f"{s.part}/{s.background}/set{s.set}_") for s in TINY.sequences)


def test_what_is_drawn_for_testing_is_never_drawn_for_training(drawn):
    textures, kinds = {"train": set(), "test": set()}, {"train": set(), "test": set()}
    for sequence, scene in ((sequence, recording.scene) for sequence, recording in drawn):
        texels = scene.bank.texels
        numbers = {part.surface.texture for body in scene.bodies for part in body.parts}
        textures[sequence.part] |= {texels[n * SIZE**2 : (n + 1) * SIZE**2].tobytes() for n in numbers}
        kinds[sequence.part] |= {body.kind for body in scene.bodies[1:]}
    assert len(textures["train"]) > 50
    assert len(textures["test"]) > 50
    assert not textures["train"] & textures["test"]
    assert kinds["train"] == set(KINDS) - set(UNSEEN)
    assert kinds["test"] == set(KINDS)


def test_every_sequence_has_the_movers_of_its_set(drawn):
    assert all(len(recording.scene.movers) in SETS[sequence.set].movers for sequence, recording in drawn)


def test_a_recording_tells_its_population_background_and_which_objects_are_new(drawn):
    for sequence, facts in ((sequence, recording.facts()) for sequence, recording in drawn):
        assert facts["population"] == "replica"
        assert facts["background"] == sequence.background
        assert facts["objects"].keys() == facts["objects_seen"].keys() == {str(k + 1) for k in range(facts["movers"])}
        new = {number for number, kind in facts["objects"].items() if kind in UNSEEN}
        assert {number for number, seen in facts["objects_seen"].items() if not seen} == new
        assert not new or sequence.part == "test"


def test_stress_scenes_tell_nothing_new_and_are_another_population():
    stress, replica = (
        simulate_recording(
            RecordingPlan(seed=3, set_number=4, seconds=0.1, size=(24, 32), part="test", population=population)
        )
        for population in ("stress", "replica")
    )
    assert not stress.facts().keys() & {"population", "background", "objects", "objects_seen"}
    assert len(stress.scene.bodies) != len(replica.scene.bodies)
    assert {body.kind for body in stress.scene.bodies} == {""}


def test_tables_of_a_replica_are_covered_with_streets(drawn):
    for sequence, recording in drawn:
        scene = recording.scene
        streets = {part.surface.texture for part in scene.bodies[0].parts} & set(scene.bank.maps.tolist())
        assert bool(streets) == (sequence.room in ("table", "tabletop"))


@pytest.mark.parametrize("population", ["easy", ""])
def test_a_population_that_does_not_exist_is_refused(population):
    with pytest.raises(BadInput, match="stress, replica"):
        simulate_recording(RecordingPlan(seed=0, population=population))


def test_a_folder_takes_recordings_of_one_population(tmp_path):
    how = {"set_number": 4, "seconds": 0.05, "size": (24, 32), "camera": "evimo", "part": "train"}
    plan = DatasetPlan(first=RecordingPlan(seed=3, population="replica", **how), minutes=0.05 / 60)
    (path,) = simulate_dataset(plan, tmp_path)
    assert open_recording(path).meta["population"] == "replica"
    with pytest.raises(BadInput, match="population replica"):
        next(simulate_dataset(replace(plan, first=replace(plan.first, population="stress")), tmp_path))


def test_a_floor_is_seen_from_above_and_a_wall_is_not(drawn):
    """The room asked for is the one drawn: both are of set 2."""
    down = {"floor": [], "wall": []}
    for sequence, recording in drawn:
        if sequence.set == 2:
            down[sequence.room].append(-recording.scene.camera.rotation[2, 2])
    assert min(down["floor"]) > max(down["wall"])


@pytest.mark.slow
def test_a_tiny_replica_is_made_and_not_twice(tmp_path, capsys):
    command = ["simulate", "--replica", "--out", str(tmp_path), "--minutes", "0.034", "--size", "32x24", "--seed", "5"]
    assert main(command) == 0
    assert "51 of them made now" in capsys.readouterr().out
    index = json.loads((tmp_path / INDEX).read_text())
    sequences = index["sequences"]
    assert len(sequences) == 51
    for sequence in sequences:
        recording = open_recording(tmp_path / sequence["path"])
        assert recording.camera == EVIMO.resized(24, 32)
        assert len(recording) == round(sequence["seconds"] / 0.025)
        assert {name: recording.meta[name] for name in ("set", "seed", "part", "room", "seconds")} == {
            name: sequence[name] for name in ("set", "seed", "part", "room", "seconds")
        }
    before = {file: file.stat().st_mtime_ns for file in tmp_path.rglob("*") if file.is_file()}
    assert main(command) == 0
    assert {file: file.stat().st_mtime_ns for file in tmp_path.rglob("*") if file.is_file()} == before
    assert main([*command[:-1], "6"]) == 2
    assert "another plan" in capsys.readouterr().err


def test_it_resumes_where_it_stopped(tmp_path):
    making = simulate_replica(TINY, tmp_path)
    first = [next(making) for _ in range(2)]
    making.close()
    made = sorted(path.parent for path in tmp_path.rglob("dataset_info.json"))
    assert made == sorted(tmp_path / sequence.path for sequence in first)
    written = {path: path.stat().st_mtime_ns for path in made}
    again = simulate_replica(TINY, tmp_path)
    assert [next(again) for _ in range(3)] == TINY.sequences[:3]
    again.close()
    assert {path: path.stat().st_mtime_ns for path in made} == written
    with pytest.raises(BadInput, match="another plan"):
        next(simulate_replica(replace(TINY, size=(24, 33)), tmp_path))


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ({"minutes": 0.01}, "0.0212"),
        ({"seed": -1}, "seed"),
        ({"size": "4x4"}, "16x16"),
        ({"size": "346"}, "WxH"),
        ({"set": "3"}, "--minutes, --seed"),
        ({"sensor": "gen4"}, "--minutes, --seed"),
        ({"camera": "evimo"}, "--minutes, --seed"),
        ({"part": "test"}, "--minutes, --seed"),
    ],
)
def test_bad_requests_say_what_would_do(how, message, tmp_path):
    with pytest.raises(BadInput, match=message):
        simulate(out=tmp_path, replica=True, **how)
    assert not list(tmp_path.iterdir())


def test_without_minutes_only_a_replica_knows_its_length(tmp_path):
    with pytest.raises(BadInput, match="--replica"):
        simulate(out=tmp_path)


@pytest.mark.parametrize(("how", "message"), [({"part": "eval"}, "train, test"), ({"room": "wall"}, "boxes")])
def test_parts_and_rooms_that_do_not_exist_are_refused(how, message):
    with pytest.raises(BadInput, match=message):
        simulate_recording(RecordingPlan(seed=0, **how))
