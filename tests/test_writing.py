"""Files and folders that are whole or not there, whatever happens to the disk or to the process."""

import errno
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from evimo.errors import BadInput
from evimo.writing import (
    MARKER,
    OutputFolder,
    explained,
    new_file,
    new_folder,
    remove_leftovers,
    save_text,
    shown,
)

WRITER = """
import sys, time
from pathlib import Path
from evimo.writing import new_folder
with new_folder(Path(sys.argv[1])) as folder:
    (folder / "half").write_text("half")
    print("writing", flush=True)
    time.sleep(60)
"""


def inside(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


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


@pytest.mark.parametrize("new", [new_file, new_folder])
def test_what_fails_leaves_no_trace(new, tmp_path):
    with pytest.raises(ZeroDivisionError), new(tmp_path / "made" / "out") as path:
        (path / "part" if path.is_dir() else path).write_text("half")
        raise ZeroDivisionError
    assert inside(tmp_path) == []


def test_a_file_has_its_old_content_until_the_new_one_is_whole(tmp_path):
    path = tmp_path / "report.json"
    save_text("old", path)
    with new_file(path) as file:
        file.write_text("new")
        assert path.read_text() == "old"
        assert file.name == path.name  # libraries go by the suffix
    assert path.read_text() == "new"
    assert inside(tmp_path) == ["report.json"]


def test_a_folder_that_another_process_has_completed_meanwhile_stays(tmp_path):
    with new_folder(tmp_path / "recording") as folder:
        (folder / "file").write_text("ours")
        (tmp_path / "recording").mkdir()
        (tmp_path / "recording" / "file").write_text("theirs")
    assert (tmp_path / "recording" / "file").read_text() == "theirs"
    assert inside(tmp_path) == ["recording", "recording/file"]


def test_what_is_made_has_the_permissions_that_the_user_wants(tmp_path):
    """The hidden folder is private; what comes out of it is not."""
    before = os.umask(0o022)
    try:
        with new_folder(tmp_path / "folder") as folder, new_file(tmp_path / "file") as file:
            (folder / "file").touch()
            file.touch()
    finally:
        os.umask(before)
    modes = [(tmp_path / name).stat().st_mode & 0o777 for name in ("folder", "folder/file", "file")]
    assert modes == [0o755, 0o644, 0o644]


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EROFS, errno.EFBIG, errno.EIO, errno.EDQUOT])
def test_what_a_disk_says_is_one_error_that_names_the_file(code, tmp_path):
    with pytest.raises(BadInput) as raised, new_file(tmp_path / "x.json", fix="fewer outputs"):
        raise OSError(code, os.strerror(code))
    assert str(raised.value) == f"cannot write {tmp_path / 'x.json'}: {os.strerror(code)}\n  try: fewer outputs"
    assert inside(tmp_path) == []


@pytest.mark.parametrize(
    "error",
    [BrokenPipeError(errno.EPIPE, "Broken pipe"), FileNotFoundError(2, "no", "/else"), OSError("what a reader says")],
)
def test_errors_about_other_files_are_not_blamed_on_the_output(error, tmp_path):
    with pytest.raises(type(error)), new_file(tmp_path / "x.json"):
        raise error
    assert inside(tmp_path) == []


def test_an_output_that_is_taken_away_meanwhile_is_one_error(tmp_path):
    """As when a disk is unmounted."""
    with pytest.raises(BadInput, match="cannot write"), new_file(tmp_path / "out" / "x.json") as file:
        (tmp_path / "out").rename(tmp_path / "elsewhere")
        file.write_text("late")


@pytest.mark.parametrize("new", [new_file, new_folder])
def test_a_file_in_the_way_of_a_folder_is_our_error(new, tmp_path):
    (tmp_path / "out").write_text("a file")
    with pytest.raises(BadInput, match="cannot write"), new(tmp_path / "out" / "x"):
        pass
    assert inside(tmp_path) == ["out"]


def test_a_folder_in_the_way_of_a_file_is_our_error_and_nothing_is_moved(tmp_path):
    (tmp_path / "b.txt").mkdir()
    with pytest.raises(BadInput, match=r"b\.txt: it is a folder"), OutputFolder(tmp_path) as folder:
        for name in ("a.txt", "b.txt"):
            folder.path(name).touch()
        folder.keep()
    assert inside(tmp_path) == ["b.txt"]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are named pipes")
def test_a_pipe_or_a_device_is_not_replaced(tmp_path):
    """As root, `--out /dev/null` would leave a file there, which then every process of the machine fills."""
    os.mkfifo(tmp_path / "b.txt")
    with pytest.raises(BadInput, match=r"b\.txt: it is a pipe or a device"), new_file(tmp_path / "b.txt"):
        pass
    with pytest.raises(BadInput, match=r"b\.txt: it is a pipe or a device"), OutputFolder(tmp_path) as folder:
        for name in ("a.txt", "b.txt"):
            folder.path(name).touch()
        folder.keep()
    assert inside(tmp_path) == ["b.txt"]
    assert (tmp_path / "b.txt").is_fifo()


def test_folders_that_cannot_be_made_are_our_error(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(BadInput, match=r"cannot write .*file/deeper"), explained(tmp_path / "file" / "deeper"):
        (tmp_path / "file" / "deeper").mkdir()


@pytest.fixture
def writing(tmp_path):
    """A process that is in the middle of writing `made`."""
    command = [sys.executable, "-c", WRITER, str(tmp_path / "made")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "writing\n"
        yield process
        process.kill()


@pytest.mark.skipif(sys.platform == "win32", reason="kills as Unix does")
def test_names_that_are_no_utf8_are_written_as_escapes(tmp_path):
    name = "K\udcfcche.raw"  # as Python has the Latin-1 of a name
    save_text(json.dumps({"of": name}, ensure_ascii=False), tmp_path / "a.json")
    assert (tmp_path / "a.json").read_bytes() == b'{"of": "K\\udcfcche.raw"}'
    assert json.loads((tmp_path / "a.json").read_text(encoding="utf-8")) == {"of": name}


def test_what_a_killed_process_left_is_removed_by_the_next_one(writing, tmp_path):
    writing.send_signal(signal.SIGKILL)
    writing.wait()
    (left,) = tmp_path.iterdir()
    assert left.name.startswith(MARKER)
    assert list(shown(tmp_path.rglob("half"), below=tmp_path)) == []
    save_text("done", tmp_path / "other")
    assert inside(tmp_path) == ["other"]


def test_what_another_process_writes_now_stays(writing, tmp_path):
    save_text("done", tmp_path / "other")
    remove_leftovers(tmp_path)
    assert list(tmp_path.rglob("half")) != []


def test_several_writers_in_one_folder_and_process_leave_each_other_alone(tmp_path):
    with new_folder(tmp_path / "a") as a:
        (a / "file").touch()
        with new_folder(tmp_path / "b") as b:
            (b / "file").touch()
        assert (a / "file").exists()
    assert inside(tmp_path) == ["a", "a/file", "b", "b/file"]


def test_a_leftover_without_a_lock_is_removed_too(tmp_path):
    (tmp_path / f"{MARKER}old").mkdir()
    (tmp_path / f"{MARKER}old" / "data").touch()
    (tmp_path / f"{MARKER}file").touch()  # no folder, so not of this program
    remove_leftovers(tmp_path)
    assert inside(tmp_path) == [f"{MARKER}file"]


def test_hidden_means_within_the_folder_that_is_searched(tmp_path):
    folder = tmp_path / ".cache" / "data"
    for name in ("a", f"{MARKER}x/b", ".y/c", "d/.z"):
        (folder / name).mkdir(parents=True)
    found = shown((path for path in folder.rglob("*")), below=folder)
    assert sorted(path.name for path in found) == ["a", "d"]
    assert MARKER.startswith(".")


@pytest.mark.parametrize("at", ["mkdir", "locked", "remove_leftovers"])
def test_a_signal_while_folders_are_made_leaves_none(tmp_path, monkeypatch, at):
    """It may come after any line, here right after the one that made something."""
    import evimo.writing as writing

    home, name = (Path, at) if at == "mkdir" else (writing, at)
    usual = getattr(home, name)

    def interrupted(*of, **how):
        usual(*of, **how)
        if at != "mkdir" or of[0].name.startswith(MARKER):
            raise KeyboardInterrupt

    monkeypatch.setattr(home, name, interrupted)
    with pytest.raises(KeyboardInterrupt), OutputFolder(tmp_path / "new" / "out"):
        pass
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("at", ["rmtree", "rmdir"])
def test_a_signal_while_folders_are_removed_leaves_none(tmp_path, monkeypatch, at):
    import evimo.writing as writing

    home, signals = writing.shutil if at == "rmtree" else Path, [KeyboardInterrupt()]
    usual = getattr(home, at)

    def interrupted(*of, **how):
        if signals:
            raise signals.pop()
        return usual(*of, **how)

    with pytest.raises(KeyboardInterrupt), OutputFolder(tmp_path / "new" / "out") as outputs:
        outputs.path("a.txt").write_text("a")
        monkeypatch.setattr(home, at, interrupted)
    assert list(tmp_path.iterdir()) == [] and not signals
