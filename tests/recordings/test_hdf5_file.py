"""HDF5 files on disks that fill up at any place, and on those that do not."""

import errno
import subprocess
import sys

import h5py
import numpy as np
import pytest

from evimo.recordings import hdf5_file
from evimo.recordings.hdf5_file import Hdf5File

WORK = """
import sys
from pathlib import Path
sys.path.insert(0, {src!r})
from evimo.recordings import hdf5_file

class Small(hdf5_file._Disk):
    def __init__(self, path):
        super().__init__(path)
        usual = self._file
        class Disk:
            room = {room}
            def write(self, content):
                if self.room <= 0:
                    raise OSError(28, "No space left on device")
                written = usual.write(content[: self.room])
                self.room -= written
                return written
            def __getattr__(self, name):
                return getattr(usual, name)
        self._file = Disk()

hdf5_file._Disk = Small
try:
    file = hdf5_file.Hdf5File(Path({path!r}), attributes=dict(model="tiny"))
    how = dict(maxshape=(None, 20, 30), chunks=(1, 20, 30), compression="gzip")
    maps = file.content.create_dataset("maps", (0, 20, 30), "u1", **how)
    rows = file.content.create_dataset("rows", (0, 6), "f8", maxshape=(None, 6), chunks=(256, 6))
    for k in range(200):
        for each in (maps, rows):
            each.resize(k + 1, axis=0)
            each[k] = k % 251
        file.check()
    file.close()
except OSError as error:
    print("told", error.errno)
    try:
        file.close()
    except (NameError, OSError):
        pass
else:
    print("fine")
"""


@pytest.mark.parametrize("room", [0, 1, 100, 2000, 5000, 9000, 20_000])
def test_a_disk_that_fills_up_is_told_and_does_not_crash_the_program(room, tmp_path):
    """h5py/h5py#914: HDF5 crashes when a program ends whose files cannot be written."""
    src = str(hdf5_file.__file__).partition("evimo/recordings")[0]
    code = WORK.format(room=room, path=str(tmp_path / "a.h5"), src=src)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"told {errno.ENOSPC}\n"


def test_a_disk_with_room_holds_what_h5py_writes_itself(tmp_path):
    values = np.random.default_rng(0).integers(0, 9, (300, 20, 30)).astype(np.uint8)
    file = Hdf5File(tmp_path / "a.h5", attributes={"model": "tiny"})
    part = file.content.create_dataset("maps", (0, 20, 30), "u1", maxshape=(None, 20, 30), chunks=(1, 20, 30))
    for k, value in enumerate(values):
        part.resize(k + 1, axis=0)
        part[k] = value
    np.testing.assert_array_equal(part[:], values)
    file.close()
    with h5py.File(tmp_path / "a.h5") as saved:
        assert saved.attrs["model"] == "tiny"
        np.testing.assert_array_equal(saved["maps"], values)
