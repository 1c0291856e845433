"""The paper's numbers, as its source prints them."""

import re
from pathlib import Path

import pytest

from evimo.benchmark.paper import CLASSIC, DEPTH, MOTION


def test_the_papers_numbers_are_the_papers():
    paper = Path(__file__).parents[3] / "shared" / "paper" / "ev-imo.tex"
    if not paper.exists():
        pytest.skip("needs ../shared/paper/ev-imo.tex")
    text = paper.read_text()
    assert _printed(text, "table:mo_est") == [(line[0], *_numbers(line)) for line in MOTION.lines]
    classic = [numbers for _, *numbers in _printed(text, "table:classic")]
    assert classic == [list(_numbers(line)) for line in CLASSIC.lines]
    by_method = sorted(DEPTH.lines, key=lambda line: ("baseline, 2 M", "40 k", "ECN").index(line[1]))
    assert _printed(text, "table:main_table_depth") == [(line[0], *_numbers(line)) for line in by_method]


def _numbers(line: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(value for value in line[2:] if value != "–")


def _printed(text: str, label: str) -> list[tuple[str, ...]]:
    """The lines of one of the paper's tables: their name and numbers; those in braces are a line of their own."""
    body = text[: text.index(rf"\label{{{label}}}")].rsplit(r"\begin{tabular}", 1)[1]
    found: list[tuple[str, ...]] = []
    for line in body.split(r"\\"):
        name = re.search(r"\\textit\{\$?([^}$~]+)", line)
        numbers = re.findall(r"(\(?)(\d\.\d{2,3})(?!\d)", line.partition(r"\textit")[2])
        for brace in ("", "("):
            if name and (chosen := [number for mark, number in numbers if mark == brace]):
                found.append((name[1], *chosen))
    return found
