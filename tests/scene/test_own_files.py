"""Digests of folders."""

from pathlib import Path

import pytest

from evimo.errors import BadFile, BadInput
from evimo.scene.own_files import content_of, own_files


def digest(folder):
    return own_files(folder, (".obj",), what="meshes", deep=True).sha256


def test_a_digest_is_of_names_and_contents_of_the_files_that_are_taken(tmp_path):
    for place in ("one", "two/below"):
        folder = tmp_path / place
        folder.mkdir(parents=True)
        (folder / "a.obj").write_text("first")
        (folder / "b.obj").write_text("second")
    one, two = tmp_path / "one", tmp_path / "two" / "below"
    same = digest(one)
    assert same == digest(two) and len(same) == 64
    (one / "notes.txt").write_text("not a mesh")
    assert digest(one) == same
    (one / "b.obj").write_text("secondly")
    assert digest(one) != same
    (two / "b.obj").rename(two / "c.obj")
    assert digest(two) != same
    (two / "a.obj").write_text("firstc.obj")
    (two / "c.obj").write_text("second")
    assert digest(two) != same


def test_what_may_not_be_read_is_an_error_that_says_so(tmp_path, monkeypatch):
    def forbidden(path, *_):
        raise PermissionError(13, "Permission denied", str(path))

    (tmp_path / "a.obj").write_text("first")
    monkeypatch.setattr(Path, "read_bytes", forbidden)
    with pytest.raises(BadFile, match=r"a\.obj cannot be read: Permission denied"):
        content_of(tmp_path / "a.obj")
    monkeypatch.setattr(Path, "is_dir", forbidden)
    with pytest.raises(BadInput, match="cannot be read: Permission denied"):
        own_files(tmp_path, (".obj",), what="meshes")


def test_names_in_any_bytes_have_a_digest(tmp_path):
    (tmp_path / "caf\udce9.obj").write_text("in Latin 1")
    assert len(digest(tmp_path)) == 64
