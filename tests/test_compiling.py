"""Compiled code is kept where that is possible, and functions work where it is not."""

import os
import stat
import warnings
from pathlib import Path

import pytest

from evimo import compiling
from evimo.compiling import announced, njit
from evimo.errors import EvimoWarning

SRC = Path(__file__).parents[1] / "src" / "evimo"


@pytest.fixture(autouse=True)
def forgetful(monkeypatch, tmp_path):
    """A temporary folder of the test's own, and nothing said before."""
    monkeypatch.setattr(compiling.tempfile, "gettempdir", lambda: str(tmp_path))
    monkeypatch.setattr(compiling, "_warned", [])
    compiling._temporary_folder.cache_clear()
    yield
    compiling._temporary_folder.cache_clear()


@pytest.fixture
def no_home(monkeypatch):
    """Neither the package nor a home can be written: numba/numba#7248."""
    from numba.core import caching, config

    kinds = [kind for kind in caching.CacheImpl._locator_classes if "UserProvided" in kind.__name__]
    monkeypatch.setattr(caching.CacheImpl, "_locator_classes", kinds)
    monkeypatch.setattr(config, "CACHE_DIR", "")


def twice(x):
    return 2 * x


def test_without_a_home_code_is_kept_in_a_folder_that_nobody_else_can_write(no_home, tmp_path):
    assert njit()(twice)(21) == 42
    (folder,) = tmp_path.iterdir()
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert [file.suffix for file in folder.rglob("*.nbc")] == [".nbc"]
    again = njit()(twice)
    assert again(4) == 8
    assert sum(again.stats.cache_hits.values()) == 1


def test_code_is_compiled_anew_where_what_its_module_imports_has_changed(no_home, tmp_path, monkeypatch):
    """Numba looks at the module of a function alone, and would go on with what others were when it was compiled."""
    other = tmp_path / "other.py"
    other.write_text("two = 2")
    monkeypatch.setattr(compiling, "_imported", lambda file: frozenset({other}))
    njit()(twice)(21)
    for content, hits in ("two = 2.0", 0), (None, 1):
        if content:
            other.write_text(content)
        again = njit()(twice)
        assert again(4) == 8
        assert sum(again.stats.cache_hits.values()) == hits


def test_kernels_are_known_by_all_that_they_are_made_of():
    kernel = SRC / "formats" / "evt3_kernel.py"
    assert {path.name for path in compiling._imported(kernel)} == {"evt3_steady_kernel.py", "evt_clock_kernel.py"}
    assert {path.name for path in compiling._imported(SRC / "classical" / "misfit.py")} == {"sharpness.py", "world.py"}


@pytest.mark.parametrize("how", ["another's", "no folder", "no temporary folder"])
def test_where_nothing_can_be_kept_functions_work_and_one_line_says_so(no_home, how, tmp_path, monkeypatch):
    folder = tmp_path / f"{compiling.FOLDER}-{os.getuid()}"
    if how == "another's":  # code that somebody else could have written is not run
        folder.mkdir()
        folder.chmod(0o777)
    elif how == "no folder":
        folder.write_text("a file")
    else:
        monkeypatch.setattr(compiling.tempfile, "gettempdir", lambda: str(tmp_path / "missing"))
    with pytest.warns(EvimoWarning, match="cannot be kept .*NUMBA_CACHE_DIR") as said:
        assert njit()(twice)(21) == 42
        assert njit()(lambda x: x + 1)(1) == 2
    assert len(said) == 1


@pytest.mark.filterwarnings("ignore:cannot cache")
def test_a_full_disk_or_a_damaged_file_of_compiled_code_is_no_failure(no_home, tmp_path):
    njit()(twice)(21)
    (kept,) = tmp_path.rglob("*.nbc")
    kept.write_bytes(kept.read_bytes()[:10])
    assert njit()(twice)(21) == 42

    again = njit()(twice)
    (index,) = tmp_path.rglob("*.nbi")
    index.unlink()
    index.mkdir()  # nothing can be written there
    with pytest.warns(EvimoWarning, match="cannot be kept"):
        assert again(1.5) == 3.0


def test_what_is_compiled_is_announced_once_and_not_after(no_home, monkeypatch):
    said = []
    function = njit()(twice)
    monkeypatch.setattr(twice, "__module__", "evimo.somewhere")
    with announced(said.append):
        function(1), function(1.0), function(2)
    assert len(said) == 1
    assert all("compiling" in line and "evimo.somewhere" in line for line in said)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        function(1 + 0j)
    assert len(said) == 1


def test_every_function_is_compiled_by_the_one_decorator():
    """Another one would fail for users without a home."""
    others = [
        str(file)
        for file in SRC.rglob("*.py")
        if file.name != "compiling.py" and ("numba.njit" in (text := file.read_text()) or "numba import njit" in text)
    ]
    assert others == []
