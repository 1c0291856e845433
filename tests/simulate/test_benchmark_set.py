"""The recordings of a benchmark: how they share the minutes, and what happens to a set of another plan."""

import json
from collections import Counter

import pytest
from pytest import approx

from evimo.errors import BadFile, BadInput
from evimo.recordings.recording import open_recording
from evimo.simulate.benchmark_set import INDEX, BenchmarkPlan, simulate_benchmark_set

TINY = BenchmarkPlan(minutes=0.01, seed=5, size=(24, 32))


@pytest.mark.parametrize("minutes", [0.01, 0.3, 1, 5, 32])
def test_backgrounds_share_the_minutes_evenly_and_planar_ones_come_on_top(minutes):
    seconds, counts = Counter(), Counter()
    sequences = BenchmarkPlan(minutes=minutes, seed=0).sequences
    for sequence in sequences:
        seconds[sequence.background] += sequence.seconds
        counts[sequence.background] += 1
    assert set(seconds) == {"table", "wall", "fast", "box", "planar"}
    assert all(each == approx(minutes * 15, abs=0.0126) for each in seconds.values())
    assert len(set(counts.values())) == 1 and counts["wall"] >= 3
    assert len({sequence.seed for sequence in sequences}) == len({sequence.path for sequence in sequences})
    if minutes >= 1:
        assert all(3.5 < sequence.seconds < 7.5 for sequence in sequences)


def test_a_set_is_made_once_of_the_test_part_and_refused_for_another_plan(tmp_path, monkeypatch):
    monkeypatch.setattr("evimo.simulate.benchmark_set.FEWEST", 1)
    made = list(simulate_benchmark_set(TINY, tmp_path))
    assert len(made) == 5 and all(now for _, now in made)
    for sequence, _ in made:
        meta = open_recording(tmp_path / sequence.path).meta
        assert (meta["part"], meta["background"], meta["seed"]) == ("test", sequence.background, sequence.seed)
        assert (meta["movers"] == 0) == (sequence.background == "planar")
    (tmp_path / made[3][0].path).rename(tmp_path / "gone")
    again = {sequence.path: now for sequence, now in simulate_benchmark_set(TINY, tmp_path)}
    assert [path for path, now in again.items() if now] == [made[3][0].path]
    with pytest.raises(BadInput, match="another plan: seed 5 instead of seed 6"):
        list(simulate_benchmark_set(BenchmarkPlan(minutes=0.01, seed=6, size=(24, 32)), tmp_path))
    (tmp_path / INDEX).write_text(json.dumps({**TINY.index(), "sequences": []}))
    with pytest.raises(BadInput, match="other sequences"):
        list(simulate_benchmark_set(TINY, tmp_path))
    (tmp_path / INDEX).write_text("{")
    with pytest.raises(BadFile, match="no index"):
        list(simulate_benchmark_set(TINY, tmp_path))


@pytest.mark.parametrize("minutes", [0, -1, float("nan"), float("inf"), 0.001])
def test_too_few_minutes_are_refused(minutes):
    with pytest.raises(BadInput, match="minutes for 4 backgrounds"):
        BenchmarkPlan(minutes=minutes, seed=0)
