"""A hostile file of each kind in each layout: one error that names it and the fix, nothing run, nothing left behind.

`pytest -rP tests/recordings/test_hostile_files.py` lists the files and what is said of them.
"""

import os
import re

import cv2
import numpy as np
import pytest
from tests.recordings.dataset_files import v1_bag, v1_meta, v1_npz, v1_text, v2_folder, v2_meta, v2_npz

from evimo.cli import main

MADE = {
    "EV-IMO npz": lambda at, meta: v1_npz(at / "seq_00.npz", meta=meta),
    "EV-IMO text": lambda at, meta: v1_text(at / "seq_00", meta=meta),
    "EVIMO2 npz": lambda at, meta: v2_npz(at / "scene_00.npz", meta=meta),
    "EVIMO2 folder": lambda at, meta: v2_folder(at / "scene_00", meta=meta),
}


class Evil:
    def __init__(self, command):
        self.command = command

    def __reduce__(self):
        return os.system, (self.command,)


def with_array(path, name, change):
    """An .npz file again, with one array changed."""
    with np.load(path, allow_pickle=True) as stored:
        arrays = {each: stored[each] for each in stored}
    arrays[name] = change(arrays[name])
    np.savez_compressed(path, **arrays)


def code(layout, path, trace):
    """Code in `meta`, which leaves a trace where it runs."""
    if layout == "EV-IMO text":
        text = (path / "meta.txt").read_text()
        (path / "meta.txt").write_text(f"{text[:-1]}\n'x': __import__('os').system('touch {trace}')}}")
        return
    evil = np.array({"meta": Evil(f"touch {trace}"), "frames": []}, object)
    with_array(path / "dataset_info.npz" if path.is_dir() else path, "meta", lambda _: evil)


def shape(layout, path, _):
    """A map that is ten columns too narrow."""
    if layout == "EV-IMO text":
        picture = path / "img" / "depth_mask_0.png"
        cv2.imwrite(str(picture), cv2.imread(str(picture), cv2.IMREAD_UNCHANGED)[:, :70])
    elif layout == "EVIMO2 folder":
        with_array(path / "dataset_mask.npz", "mask_0000000003", lambda mask: mask[:, :70])
    else:
        with_array(path, "mask", lambda mask: mask[:, :, :70])


def missing(meta):
    del meta["frames"][2]["cam"]["pos"]["t"]["z"]


def unposed(meta):
    del meta["frames"][2]["cam"]


def not_numbers(meta):
    for entry in meta["full_trajectory"]:
        entry["cam"]["pos"]["t"]["x"] = float("nan")


def back(meta):
    meta["frames"][5]["ts"] = 0.1


SAID = {
    code: {"EV-IMO text": r"meta\.txt, line \d+ is no literal of numbers", "": "`meta` in .* may run code: refused"},
    missing: {"": r"\['frames'\]\[2\]\['cam'\]\['pos'\]\['t'\] lacks 'z'"},
    unposed: {"": r"\['frames'\]\[2\] has maps, and lacks 'cam'"},
    shape: {"EV-IMO text": "says 60x80 px, the maps are 70x60", "": r"60, 70\)"},
    not_numbers: {"": "has no frame with maps and known motion"},
    back: {"": r"\['frames'\]\[5\] goes back in time, from 0\.301000 s to 0\.100000 s"},
}


@pytest.mark.parametrize("layout", MADE)
@pytest.mark.parametrize("spoil", SAID, ids=lambda spoil: spoil.__name__)
def test_hostile_files_are_one_error(tmp_path, capsys, layout, spoil):
    meta, trace, out = v1_meta() if layout.startswith("EV-IMO ") else v2_meta(), tmp_path / "ran", tmp_path / "out"
    if spoil in (code, shape):
        path = MADE[layout](tmp_path, meta)
        spoil(layout, path, trace)
    else:
        spoil(meta)
        path = MADE[layout](tmp_path, meta)
    assert main(["convert", str(path), "--layout", "hdf5", "--out", str(out)]) == 2
    said = capsys.readouterr().err
    print(f"{layout}, {spoil.__name__}:\n{said}".replace(str(tmp_path), "."))
    assert "Traceback" not in said and not trace.exists()
    assert len([line for line in said.splitlines() if line.startswith("  try: ")]) == 1
    assert re.search(SAID[spoil].get(layout, SAID[spoil][""]), said)
    assert not list(out.rglob("*.h5")) if out.exists() else True


@pytest.mark.parametrize("number", [np.nan, np.inf, 1e300])
def test_a_bag_whose_poses_are_no_numbers_is_one_error(tmp_path, capsys, number):
    path = v1_bag(tmp_path / "seq_00", rig_as=lambda pose: np.where(np.eye(4, 4, 3) == 1, number, pose))
    assert main(["check", str(path)]) == 3
    said = capsys.readouterr().out
    print(f"EV-IMO bag, poses of {number}:\n{said}".replace(str(tmp_path), "."))
    assert re.search(r"! truth .* no pose of the camera is of the events' time", said)


def test_a_bag_without_the_camera_is_one_error(tmp_path, capsys):
    path = v1_bag(tmp_path / "seq_00")
    content = path.read_bytes()
    path.write_bytes(content.replace(b"/vicon/DVS346", b"/vicon/DVS999"))
    assert main(["check", str(path)]) == 3
    said = capsys.readouterr().out
    print(f"EV-IMO bag, without the camera:\n{said}".replace(str(tmp_path), "."))


def test_bytes_of_a_bag_that_are_not_what_they_were_are_never_a_traceback(tmp_path, capsys):
    path = v1_bag(tmp_path / "seq_00")
    content = bytearray(path.read_bytes())
    for at in np.random.default_rng(3).integers(13, len(content), 400):
        content[at] ^= 0xFF
    path.write_bytes(content)
    assert main(["check", str(path)]) in (2, 3)
    said = capsys.readouterr()
    assert "Traceback" not in said.out + said.err
