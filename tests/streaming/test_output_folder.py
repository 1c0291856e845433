import pytest

from evimo.errors import BadInput
from evimo.streaming.output_folder import OutputFolder


def test_new_files_replace_old_ones_only_when_kept(tmp_path):
    out = tmp_path / "a" / "b"
    with OutputFolder(out) as folder:
        folder.path("one.txt").write_text("first")
        folder.keep()
    (out / "mine.txt").write_text("the user's")
    with OutputFolder(out) as folder:
        folder.path("one.txt").write_text("second")
        assert (out / "one.txt").read_text() == "first"
    assert (out / "one.txt").read_text() == "first"
    with OutputFolder(out) as folder:
        folder.path("one.txt").write_text("third")
        folder.path("two.txt").write_text("new")
        assert folder.keep() == [out / "one.txt", out / "two.txt"]
    assert {path.name: path.read_text() for path in out.iterdir()} == {
        "one.txt": "third",
        "two.txt": "new",
        "mine.txt": "the user's",
    }


def test_a_failure_leaves_no_trace(tmp_path):
    with pytest.raises(ZeroDivisionError), OutputFolder(tmp_path / "out") as folder:
        folder.path("one.txt").write_text("half")
        raise ZeroDivisionError
    assert not list(tmp_path.rglob("*.txt"))
    assert not (tmp_path / "out").exists()


def test_a_failure_keeps_a_folder_that_was_there(tmp_path):
    with OutputFolder(tmp_path):
        pass
    assert tmp_path.exists()


def test_a_file_in_the_way_is_our_error(tmp_path):
    (tmp_path / "out").write_text("a file")
    with pytest.raises(BadInput, match="cannot write"):
        OutputFolder(tmp_path / "out")
