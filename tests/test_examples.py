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


def test_python_in_readme_is_an_example():
    shown = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), flags=re.DOTALL)
    examples = [example.read_text().splitlines() for example in EXAMPLES]
    assert shown
    assert [block for block in shown if not any(is_part(block.splitlines(), lines) for lines in examples)] == []


def is_part(shown: list[str], lines: list[str]) -> bool:
    """Whether the shown lines stand in the example, in the same order."""
    rest = iter(lines)
    return all(line in rest for line in shown)
