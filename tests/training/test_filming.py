import itertools
import os
import signal
from dataclasses import asdict, replace
from multiprocessing.process import BaseProcess

import pytest

from evimo.errors import EvimoError
from evimo.training import film_plan
from evimo.training.film_plan import KEPT, FilmPlan
from evimo.training.filming import filming

PLAN = FilmPlan(populations=("replica", "stress"), batch=4, seed=1, samples_per_slice=2, seconds=0.05, size=(24, 32))


def test_every_slice_is_in_as_many_samples_as_asked_for():
    plan = replace(PLAN, seconds=0.25)
    drawn = {}
    for step in range(400):
        for generation in (wanted := plan.generations(step, 1)):
            drawn[generation] = drawn.get(generation, 0) + 1 / len(wanted)
    settled = [samples for generation, samples in sorted(drawn.items())[KEPT:-KEPT]]
    assert settled == pytest.approx([10 * 2] * len(settled))


def test_places_get_their_recordings_in_turns():
    """Four places, a new recording for each every four steps: one comes at every step."""
    new = [
        [place for place in range(4) if PLAN.generations(step, place)[-1] > PLAN.generations(step - 1, place)[-1]]
        for step in range(1, 9)
    ]
    assert sorted(itertools.chain(*new[:4])) == [0, 1, 2, 3]
    assert all(len(places) == 1 for places in new)


@pytest.mark.parametrize("begin", [0, 37])
def test_the_schedule_brings_what_steps_need_in_the_order_of_need(begin):
    here, coming = set(), PLAN.schedule([1, 3], begin)
    for step in range(begin, begin + 30):
        for place in (1, 3):
            for generation in PLAN.generations(step, place):
                while (place, generation) not in here:
                    here.add(next(coming))
    ahead = {(place, generation) for place, generation in here if generation > PLAN.generations(step, place)[-1]}
    assert ahead == set()


@pytest.fixture
def told(monkeypatch):
    """What is asked of the simulator, which films nothing."""
    asked = []

    class Found:
        event_t = (1,)

    def simulate(plan):
        asked.append(asdict(plan))
        return Found()

    monkeypatch.setattr(film_plan, "simulate_recording", simulate)
    monkeypatch.setattr(film_plan, "filmed", lambda recording: recording)
    return asked


def test_populations_and_sets_take_turns_and_seeds_never_come_twice(told):
    for generation in range(12):
        for place in range(4):
            PLAN.recording(place, generation)
            replace(PLAN, seed=2).recording(place, generation)
    assert len({each["seed"] for each in told}) == len(told) == 96
    kinds = [(each["population"], each["set_number"]) for each in told]
    assert all(kinds.count(kind) == 8 for kind in itertools.product(("replica", "stress"), range(1, 7)))
    assert {each["part"] for each in told} == {"train"}


@pytest.mark.slow
def test_workers_film_what_the_plan_says_whoever_is_faster():
    def filmed(workers, begin=0):
        with filming(PLAN, workers=workers) as source:
            return [
                [[each.event_t.sum() for each in choices[0].recordings] for choices in source(step, range(4))]
                for step in range(begin, 6)
            ]

    alone = filmed(1)
    assert alone == filmed(3)
    assert alone[4:] == filmed(2, begin=4)
    assert len({sum(each) for step in alone for each in step}) > 4


@pytest.mark.slow
def test_a_worker_that_dies_is_missed():
    with filming(PLAN, workers=1) as source:
        source(0, range(4))
        os.kill(source.processes[0].pid, signal.SIGKILL)
        with pytest.raises(EvimoError, match="has ended"):
            for step in range(1, 50):
                source(step, range(4))


@pytest.mark.slow
def test_workers_are_deaf_to_ctrl_c_from_their_beginning(monkeypatch, capfd):
    """A terminal sends it to them as well, and they would tell of it while they import what they need."""
    usual = BaseProcess.start

    def start(process):
        usual(process)
        os.kill(process.pid, signal.SIGINT)

    monkeypatch.setattr(BaseProcess, "start", start)
    with filming(PLAN, workers=2) as source:
        assert len(source(0, range(4))) == 4
    assert "Traceback" not in capfd.readouterr().err
