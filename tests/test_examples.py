"""Every example runs on the packaged recording, and README shows the examples as they are."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import evimo.samples

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


@pytest.mark.slow
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.name)
def test_example_runs_on_the_sample(example: Path, tmp_path: Path):
    command = [sys.executable, str(example), str(evimo.samples.path())]
    ran = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout


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
