"""`evimo simulate --texture-dir --mesh-dir` and `evimo view` of what it made, as a user types them."""

import cv2
import numpy as np
import pytest

from evimo.cli import main
from evimo.recordings.facts import facts_of
from evimo.simulate.own_folders import forget

TENT = "v 0 0 0\nv 4 0 0\nv 0 2 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
TINY = ["--minutes", "0.001", "--seconds", "0.05", "--size", "44x33", "--set", "5"]


@pytest.fixture
def things(tmp_path):
    folder = tmp_path / "things"
    folder.mkdir()
    (folder / "tent.obj").write_text(TENT)
    (folder / "readme.txt").write_text("a tent")
    return folder


def test_a_folder_of_meshes_from_simulating_to_viewing(things, tmp_path, capsys):
    (tmp_path / "photos").mkdir()
    cv2.imwrite(str(tmp_path / "photos" / "a.png"), np.random.default_rng(0).integers(0, 255, (64, 64), np.uint8))
    out = tmp_path / "out"
    own = ["--mesh-dir", str(things), "--texture-dir", str(tmp_path / "photos")]
    assert main(["simulate", *TINY, *own, "--out", str(out)]) == 0
    said = capsys.readouterr().err.splitlines()
    assert said.count(f"warning: 1 of 2 files in {things} are no meshes and left out") == 1
    assert [line for line in said if line.startswith("reading")] == [f"reading the meshes of {things}"]
    assert {"meshes", "textures"} < set(facts_of(out / "set5_000000"))

    assert main(["simulate", *TINY, "--out", str(out)]) == 2
    assert "made with textures of sha256" in capsys.readouterr().err
    view = ["view", str(out / "set5_000000"), "--save", str(tmp_path / "v.mp4")]
    assert main(view) == 0
    assert "warning" not in capsys.readouterr().err
    (things / "tent.obj").write_text(TENT.replace("v 4", "v 5"))
    forget()
    assert main(view) == 0
    assert "the meshes in" in (said := capsys.readouterr().err) and "cannot be rendered again" in said


@pytest.mark.parametrize("option", ["--mesh-dir", "--texture-dir"])
@pytest.mark.parametrize("replica", [[], ["--replica"]])
@pytest.mark.parametrize("name", ["missing", "empty", "a.txt", "damaged"])
def test_a_folder_of_no_use_is_one_error_before_anything_is_written(option, replica, name, tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    (tmp_path / "a.txt").write_text("no folder")
    (tmp_path / "damaged").mkdir()
    for damaged in ("x.png", "x.ply"):
        (tmp_path / "damaged" / damaged).write_bytes(b"rubbish")
    plan = ["--replica", "--minutes", "0.1", "--size", "32x24"] if replica else TINY
    assert main(["simulate", *plan, option, str(tmp_path / name), "--out", str(tmp_path / "out")]) == 2
    said = [
        line
        for line in capsys.readouterr().err.splitlines()
        if not line.startswith(("reading", "warning", "compiling", "still"))
    ]
    assert len(said) == 2 and said[0].startswith("error: ") and said[1].startswith("  try: ")
    assert name in said[0]
    assert not (tmp_path / "out").exists()
