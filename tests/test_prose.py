"""The documentation's one width: prose has at most 100 columns; tables, code and what cannot be broken may be wider."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
WIDTH = 100
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])


def too_wide(text: str) -> list[int]:
    """The numbers of the lines of prose that could be broken and were not."""
    wide: list[int] = []
    fenced = False
    for number, line in enumerate(text.splitlines(), 1):
        fence = line.lstrip().startswith("```")
        fenced ^= fence
        other = fence or fenced or line.startswith(("|", "#", "    ", "<", "!["))
        if not other and len(line) > WIDTH and " " in _breakable(line.strip()):
            wide.append(number)
    return wide


def _breakable(line: str) -> str:
    """The line without the spaces that code spans hold."""
    return re.sub(r"`[^`]*`", lambda span: span.group().replace(" ", ""), line)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_prose_has_one_width(page: Path) -> None:
    assert not too_wide(page.read_text(encoding="utf-8"))


def test_a_wide_line_is_found_and_a_table_is_none() -> None:
    wide = "word " * 21
    text = f"{wide}\n\n| {wide} |\n\n    {wide}\n\n```\n{wide}\n```\n{wide}\n"
    assert too_wide(text) == [1, 10]
