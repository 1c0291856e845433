"""What bench/variant.py changes, for the tables of what each loss, slice and shape is worth."""

import importlib
from pathlib import Path

import pytest

from evimo.training.recipes import RECIPES

BENCH = Path(__file__).parents[1] / "bench"


@pytest.fixture
def variant(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCH))
    return importlib.import_module("variant")


def test_a_term_changes_in_both_passes_where_both_have_it(variant):
    paper = RECIPES["paper"]
    changed = variant.changed(paper, variant.changes(["depth=0", "mask=1", "mask_one_sided=0"]), 0.15)
    assert changed.first == {**paper.first, "depth": 0}
    assert changed.weights == {**paper.weights, "depth": 0, "mask": 1, "mask_one_sided": 0}
    assert changed.moving_share == 0.15


def test_nothing_changes_that_is_not_asked_for(variant):
    assert variant.changed(RECIPES["shipped"], {}, None) == RECIPES["shipped"]


@pytest.mark.parametrize(("slices", "asked", "reach"), [(1, 2, 0), (3, 2, 1), (3, 0, 0), (5, 2, 2), (5, 1, 1)])
def test_no_stack_reaches_further_than_the_slices_there_are_to_see(slices, asked, reach, variant):
    def reached(recording, middle, *, reach):
        return reach

    assert variant.few(reached, slices)(None, 7, reach=asked) == reach
