"""Every example runs on the packaged recording, and README shows the examples as they are."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import evimo.samples

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
WHOLE_PAPER = ROOT / "examples" / "whole_paper.py"
OF_A_RECORDING = [example for example in EXAMPLES if example != WHOLE_PAPER]


@pytest.mark.slow
@pytest.mark.parametrize("example", OF_A_RECORDING, ids=lambda example: example.name)
def test_example_runs_on_the_sample(example: Path, tmp_path: Path):
    command = [sys.executable, str(example), str(evimo.samples.path())]
    ran = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout


@pytest.mark.slow
def test_the_whole_paper_is_done_from_captures_to_scores(tmp_path: Path):
    """Two slices of each recording, small ones; whether anything is learned in two steps is not asked."""
    small = ["--minutes", "0.01", "--size", "87x65", "--steps", "2"]
    command = [sys.executable, str(WHOLE_PAPER), str(tmp_path / "paper"), *small]
    ran = subprocess.run(command, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    annotated = re.findall(r"(train|test), \d\d_set(\d)_\w+ +(\d) of (\d) +(\S+) +(\S+)% +(\S+)%", ran.stdout)
    assert sorted({int(each[1]) for each in annotated}) == [1, 2, 3, 4, 5, 6]
    assert len(annotated) == 12
    for _, _, made, exact, iou, _, near in annotated:
        assert made == exact == "2"
        assert iou == "–" or float(iou) > 0.9  # of objects of a dozen pixels, and noise that knows no pixels
        assert float(near) > 99
    for row in ("model", "one depth everywhere", "simulate and capture", "annotate", "train", "score"):
        assert re.search(rf"^ *{row} .*\d", ran.stdout, flags=re.MULTILINE), row
    again = subprocess.run(command, capture_output=True, text=True)
    assert again.returncode == 2
    assert "is there already" in again.stderr


@pytest.mark.slow
def test_the_page_of_python_runs_from_top_to_bottom(tmp_path: Path):
    """Blocks of Python in one process, and the commands between them."""
    page = (ROOT / "docs" / "python.md").read_text()
    steps = re.findall(r"```python\n(.*?)```|^    (evimo [^\n]*)$", page, flags=re.DOTALL | re.MULTILINE)
    assert len(steps) > 7
    command = "import subprocess, sys; subprocess.run([sys.executable, '-m', 'evimo.cli', *{!r}], check=True)"
    program = "\n".join(block or command.format(line.split()[1:]) for block, line in steps)
    ran = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    assert "of moving objects" in ran.stdout


def test_python_in_readme_is_an_example():
    shown = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), flags=re.DOTALL)
    examples = [example.read_text().splitlines() for example in EXAMPLES]
    assert shown
    assert [block for block in shown if not any(is_part(block.splitlines(), lines) for lines in examples)] == []


def is_part(shown: list[str], lines: list[str]) -> bool:
    """Whether the shown lines stand in the example, in the same order."""
    rest = iter(lines)
    return all(line in rest for line in shown)
