"""`evimo run` over several recordings: alone, by two processes, and again."""

import json
import os
from pathlib import Path

import h5py
import numpy as np
import pytest

from evimo.cli import main
from evimo.cli.several import folders_of
from evimo.errors import BadInput


def asked(recordings, network: Path, out: Path, *more: str) -> list[str]:
    return ["run", *map(str, recordings), "--model", str(network), "--out", str(out), "--no-video", *more]


@pytest.fixture
def two(recording: Path, tmp_path: Path) -> list[Path]:
    other = tmp_path / "other.txt"
    other.write_text("\n".join(recording.read_text().splitlines()[::2]))
    return [recording, other]


def summaries(out: Path) -> dict[str, int]:
    return {str(path.parent.relative_to(out)): path.stat().st_mtime_ns for path in out.rglob("summary.json")}


@pytest.mark.slow
def test_several_recordings_have_a_folder_each_whoever_runs(two, fake_network, tmp_path, capsys):
    for crew in ("1", "2"):
        assert main(asked(two, fake_network, tmp_path / crew, "--sensor", "32x24", "--workers", crew)) == 0
        said = capsys.readouterr()
        assert said.out == f"2 recordings in {tmp_path / crew}, 2 of them run over now\n"
        warned = sorted(line for line in said.err.splitlines() if line.startswith("warning"))
        assert [line.split(": no calibration")[0] for line in warned] == [
            f"warning: {path}" for path in sorted(map(str, two))
        ]
    assert main(asked(two[:1], fake_network, tmp_path / "single", "--sensor", "32x24")) == 0
    for name in ("square", "other"):
        one, other = (tmp_path / crew / name for crew in ("1", "2"))
        assert {path.name for path in one.iterdir()} == {path.name for path in other.iterdir()}
        assert (one / "egomotion.csv").read_bytes() == (other / "egomotion.csv").read_bytes()
    for table in ("egomotion.csv", "objects.csv"):
        assert (tmp_path / "single" / table).read_bytes() == (tmp_path / "2" / "square" / table).read_bytes()
    with h5py.File(tmp_path / "single" / "estimates.h5") as one, h5py.File(tmp_path / "2/square/estimates.h5") as same:
        np.testing.assert_array_equal(one["rel_depth"][:], same["rel_depth"][:])
    told = [json.loads((tmp_path / at / "summary.json").read_text()) for at in ("single", "2/square")]
    assert told[0]["settings"] == told[1]["settings"] and told[0]["warnings"] == told[1]["warnings"]


def test_only_what_is_not_finished_is_run_over_again(two, fake_network, tmp_path, capsys):
    out = tmp_path / "out"
    command = asked(two, fake_network, out, "--sensor", "32x24")

    def made(*more: str) -> int:
        assert main([*command, *more]) == 0
        return int(capsys.readouterr().out.split(", ")[1].split()[0])

    assert (made(), made()) == (2, 0)
    before = summaries(out)
    summary = out / "other" / "summary.json"
    summary.write_text(summary.read_text().replace('"interrupted": false', '"interrupted": true'))
    assert made() == 1
    assert summaries(out)["square"] == before["square"]
    assert (made("--imu", "off"), made("--imu", "off"), made("--imu", "off", "--no-dense")) == (2, 0, 2)
    os.utime(two[0])
    assert made("--imu", "off", "--no-dense") == 1


def test_a_broken_recording_costs_its_own_results(two, fake_network, tmp_path, capsys):
    broken = tmp_path / "cut.aedat4"
    broken.write_bytes(b"#!AER-DAT4.0\r\n")
    out = tmp_path / "out"
    assert main(asked([broken, *two], fake_network, out, "--sensor", "32x24")) == 2
    error, fix = capsys.readouterr().err.splitlines()[-2:]
    assert error.startswith("error: ") and str(broken) in error and fix.startswith("  try: ")
    assert summaries(out).keys() == {"square", "other"}
    assert sorted(path.name for path in out.iterdir()) == ["other", "square"]


def test_one_recording_for_a_process_is_written_where_it_is_when_alone(recording, fake_network, tmp_path, capsys):
    assert main(asked([recording], fake_network, tmp_path / "out", "--sensor", "32x24", "--workers", "2")) == 0
    assert summaries(tmp_path / "out").keys() == {"."}


def test_folders_are_named_so_that_they_differ(tmp_path):
    def named(*paths: str) -> list[str]:
        return [str(folder) for folder in folders_of([tmp_path / path for path in paths], Path("o")).values()]

    assert named("a.bag", "sub/b.bag") == ["o/a", "o/b"]
    assert named("one/events.npz", "two/events.npz", "two/other.npz") == ["o/one/events", "o/two/events", "o/two/other"]
    with pytest.raises(BadInput, match=r"a\.bag and .*a\.npz would both be written to o/a"):
        named("a.bag", "a.npz")


def test_a_recording_that_is_not_there_is_said_before_the_first_is_run_over(two, fake_network, tmp_path, capsys):
    assert main(asked([*two, Path("none")], fake_network, tmp_path / "out", "--sensor", "32x24")) == 2
    assert capsys.readouterr().err == "error: there is no file or folder 'none'\n  try: check the path\n"
    assert not (tmp_path / "out").exists()
