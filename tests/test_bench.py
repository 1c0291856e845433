"""The scripts of bench/ can at least be imported: they are not part of the package, and nothing else would notice."""

import importlib
from pathlib import Path

import pytest

BENCH = Path(__file__).parents[1] / "bench"


@pytest.mark.parametrize("name", sorted(path.stem for path in BENCH.glob("*.py")))
def test_a_script_imports(name, monkeypatch):
    monkeypatch.syspath_prepend(str(BENCH))
    assert importlib.import_module(name).__doc__
