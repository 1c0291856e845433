import shutil
import sys

import pytest

from evimo.locks import LOCK, locked, remove


@pytest.mark.skipif(sys.platform == "win32", reason="nothing that is open can be removed there")
def test_a_folder_that_another_process_makes_meanwhile_stays(tmp_path, monkeypatch):
    """A folder of a known name, as that of a download, may be made and locked anew as soon as its lock is removed."""
    folder, others = tmp_path / "hidden", []
    folder.mkdir()
    ours = locked(folder, unsure=False)
    usual = shutil.rmtree

    def removed(path, **how):
        usual(path, **how)
        if not others:
            path.mkdir()
            others.append(locked(path, unsure=False))

    monkeypatch.setattr(shutil, "rmtree", removed)
    assert ours is not None
    remove(folder, ours)
    assert (folder / LOCK).exists()
    assert locked(folder, unsure=False) is None
    remove(folder, others[0])
    assert list(tmp_path.iterdir()) == []
