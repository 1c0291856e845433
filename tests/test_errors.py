import json
import pickle
import sys
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import pytest

from evimo import errors
from evimo.errors import BadFile, BadInput, MissingExtra, NotFound, check_installed, how_to_install


@pytest.mark.parametrize("kind", [BadFile, BadInput, MissingExtra, NotFound])
def test_errors_come_back_from_other_processes_as_they_were(kind):
    error = kind("the file is empty", fix="record it again")
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is kind
    assert (str(again), again.problem, again.fix) == (str(error), error.problem, error.fix)


def test_names_cannot_begin_a_line_or_steer_a_terminal():
    error = BadFile("a\nb\x1b[31m é: no recording", fix="another\rfile")
    assert str(error) == "a\\nb\\x1b[31m é: no recording\n  try: another\\rfile"
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


@pytest.fixture
def installed_from(monkeypatch):
    """Makes pip's note of where the package came from say this."""

    class Distribution:
        def __init__(self, told):
            self.told = told

        def read_text(self, name):
            return self.told and json.dumps(self.told)

    def put(told):
        monkeypatch.setattr(errors, "distribution", lambda name: Distribution(told))

    return put


def test_an_extra_is_added_from_where_the_package_came_from(installed_from, tmp_path):
    pip, url = f'"{sys.executable}" -m pip install', tmp_path.as_uri()
    installed_from({"url": url, "dir_info": {}})
    assert how_to_install("train") == f'{pip} "{tmp_path}[train]"'
    (tmp_path / "constraints.txt").touch()
    installed_from({"url": url, "dir_info": {"editable": True}})
    assert how_to_install("train") == f'{pip} -c "{tmp_path / "constraints.txt"}" -e "{tmp_path}[train]"'
    wheel = tmp_path / "a b.whl"
    wheel.touch()
    installed_from({"url": wheel.as_uri(), "archive_info": {}})
    assert how_to_install("view") == f'{pip} "evimo[view] @ {wheel.as_uri()}"'
    git = {"url": "https://host/evimo.git", "vcs_info": {"vcs": "git", "commit_id": "abc"}}
    installed_from(git)
    assert how_to_install("cuda") == f'{pip} "evimo[cuda] @ git+https://host/evimo.git@abc"'
    installed_from(None)  # from an index, which then has it
    assert how_to_install("cuda") == f'{pip} "evimo[cuda]"'
    installed_from({"url": (tmp_path / "gone").as_uri(), "dir_info": {}})
    assert how_to_install("cuda") == f'{pip} "evimo[cuda]"'


def test_a_clone_that_was_never_installed_is_told_to_install_itself(monkeypatch):
    def missing(name):
        raise PackageNotFoundError(name)

    monkeypatch.setattr(errors, "distribution", missing)
    root = Path(__file__).parents[1]
    assert how_to_install("train").endswith(f' -e "{root}[train]"')
    assert f'-c "{root / "constraints.txt"}"' in how_to_install("train")


def test_what_is_missing_is_named(installed_from):
    installed_from(None)
    check_installed("this", "json", extra="train")
    with pytest.raises(MissingExtra, match="this needs no_such and neither") as raised:
        check_installed("this", "json", "no_such", "neither", extra="train")
    assert raised.value.fix == how_to_install("train")


def test_nobody_else_gives_this_advice():
    """One function knows where the package came from."""
    src = Path(errors.__file__).parent
    others = [str(file) for file in src.rglob("*.py") if file.name != "errors.py" and "pip install" in file.read_text()]
    assert others == []
