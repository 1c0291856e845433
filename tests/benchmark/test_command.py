"""`evimo benchmark` on recordings made by hand, with models that know the truth or half of it."""

import csv
import io
import json
import re
from html.parser import HTMLParser

import pytest
from pytest import approx
from tests.benchmark.written import MODELS, values_in

from evimo.cli import main

pytest.importorskip("matplotlib", reason="needs the extra [benchmark]")


def test_the_tables_say_what_is_worked_out_by_hand(no_page, command, tmp_path):
    assert main(command) == 0
    values = values_in(tmp_path / "out")
    for scene in ("wall", "table"):
        assert values["II", scene, "perfect", "iou"] == approx(1)
        assert values["II", scene, "half", "iou"] == approx(50 / 140)  # half of 100 px, and 40 px of the wall
        assert values["II", scene, "everything moves", "iou"] == approx(100 / 1200)
        assert values["II", scene, "perfect", "camera_aee"] == approx(0, abs=1e-6)
        assert values["II", scene, "half", "camera_rre"] == approx(0.2)
        assert values["II", scene, "zero twist", "camera_aee"] == approx(0.5)
        assert values["II", scene, "half", "objects_found"] == 0
        assert values["IV", scene, "perfect", "abs_rel"] == approx(0, abs=2e-3)
        assert values["IV", scene, "half", "abs_rel"] == approx(100 / 1200)  # 2 m where the square is at 1 m
        assert values["IV", scene, "one depth everywhere", "abs_rel"] == approx(100 / 1200)
    assert values["III", "planar", "half", "camera_aee_depth"] == approx(0, abs=1e-6)
    assert values["III", "planar", "half", "camera_rre"] == approx(0.2)
    assert {table for table, *_ in values} == {"II", "III", "IV"}
    assert {scene for table, scene, *_ in values if table == "II"} == {"wall", "table"}


def test_the_papers_numbers_stand_apart(no_page, command, tmp_path):
    main(command)
    out = tmp_path / "out"
    page = (out / "benchmark.md").read_text()
    assert page.index("### The paper's numbers, for Table II\n") > page.index("## Table II. ")
    ours, theirs = page.split("### The paper's numbers, for Table II\n")[0], page
    assert "2 M parameters" not in ours and "2 M parameters" in theirs
    assert "not comparable" in ours
    assert "2 M" not in (out / "benchmark.csv").read_text()
    told = json.loads((out / "benchmark.json").read_text())
    assert set(told["paper"]) == {"measured on", "tables"} and len(told["paper"]["tables"]) == 3


def test_reports_say_how_it_was_measured(no_page, command, tmp_path, capsys):
    main(command)
    page = (tmp_path / "out" / "benchmark.md").read_text()
    for fact in ("25 ms", "3 cm/s", "0.5", "digest of half", "seeds 7 to 8", "true norm per slice", "samples kept"):
        assert fact in page, fact
    assert "4 slices, 4 slices with movers, seed 9" in page
    printed = capsys.readouterr().out
    assert "Table III" in printed and "saved in" in printed


class Page(HTMLParser):
    """Counts tags, and collects what a browser would fetch."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.fetched: list[str] = []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.fetched += [value for name, value in attrs if name in ("src", "href", "xlink:href", "srcset") and value]


def test_the_page_is_whole_in_itself(command, tmp_path):
    main(command)
    text = (tmp_path / "out" / "benchmark.html").read_text()
    page = Page()
    page.feed(text)
    assert all(each.startswith(("#", "data:image/png;base64,")) for each in page.fetched)
    assert "script" not in page.tags and "link" not in page.tags and "@import" not in text and "url(http" not in text
    assert page.tags.count("svg") == 7
    assert page.tags.count("img") == 3  # of each recording with movers its worst slice
    assert "Precision and recall" in text and "IoU by sequence" in text
    assert len(set(re.findall(r'<section id="([^"]+)"', text))) == 6


def test_names_of_files_are_neither_formulas_nor_html(command, recordings, saved, tmp_path):
    saved(recordings / "wall" / r"$\nothing$<i>", background="wall", seed=11)
    assert main(command) == 0
    text = (tmp_path / "out" / "benchmark.html").read_text()
    assert r"$\nothing$&lt;i&gt;" in text and "<i>" not in text


def test_legends_name_every_model(command, tmp_path):
    assert main([*command, "_mine"]) == 0
    drawings = re.findall(r"<svg.*?</svg>", (tmp_path / "out" / "benchmark.html").read_text(), flags=re.DOTALL)
    assert len(drawings) == 7
    for drawing in drawings:
        texts = [text.strip("\u200b") for text in re.findall(r"<text[^>]*>([^<]*)</text>", drawing)]
        assert {"half", "perfect", "_mine"} <= set(texts)


@pytest.mark.parametrize(
    ("others", "title", "notice"),
    [
        ("", "# EV-IMO’s experiments on simulated recordings\n", "All of these numbers are measured on simulated"),
        ("a", "# EV-IMO’s experiments\n", "3 of 4 recordings are simulated: some of these numbers are measured on"),
        ("abcd", "# EV-IMO’s experiments\n", ""),
    ],
)
def test_nothing_simulated_is_called_real(others, title, notice, no_page, command, recordings, tmp_path):
    for info in recordings.rglob("dataset_info.json"):
        if info.parent.name in others:  # made of a capture, as `evimo annotate` does
            info.write_text(info.read_text().replace('"seed"', '"made_from"'))
    assert main(command) == 0
    page = (tmp_path / "out" / "benchmark.md").read_text()
    assert page.startswith(title) and notice in page and ("simulated recordings" in page) == bool(notice)


def test_folders_of_ev_imo_name_the_background(no_page, runs, saved, tmp_path):
    saved(tmp_path / "eval" / "wall" / "seq_00", background=None)
    assert main(["benchmark", "--data", str(tmp_path / "eval"), "--out", str(tmp_path / "out"), *MODELS]) == 0
    assert ("II", "wall", "half", "iou") in values_in(tmp_path / "out")


def test_recordings_of_no_known_background_have_a_block_of_their_own(no_page, command, recordings, saved, tmp_path):
    for k in range(2):
        saved(recordings / f"mine{k}", background=None)
    assert main(command) == 0
    values = values_in(tmp_path / "out")
    scenes = {table: {scene for key, scene, *_ in values if key == table} for table in ("II", "III", "IV")}
    both = {"wall", "table", "other recordings"}
    assert scenes == {"II": both, "III": {"planar"}, "IV": both}
    assert values["II", "other recordings", "half", "iou"] == approx(50 / 140)
    rows = csv.DictReader(io.StringIO((tmp_path / "out" / "benchmark.csv").read_text()))
    kept = {(row["table"], row["scene"]): row["samples"] for row in rows if row["score"] in ("iou", "abs_rel")}
    assert kept["II", "other recordings"] == kept["IV", "other recordings"] == "8"  # slices of two recordings


def test_recordings_that_no_table_of_the_paper_has_are_in_it_all_the_same(no_page, runs, saved, tmp_path):
    """Boxes are in Table IV of the paper alone; who has nothing else sees their masks."""
    saved(tmp_path / "mine" / "first", background="box")
    assert main(["benchmark", "--data", str(tmp_path / "mine"), "--out", str(tmp_path / "out"), *MODELS]) == 0
    values = values_in(tmp_path / "out")
    assert values["II", "all recordings", "half", "iou"] == approx(50 / 140)
    assert {scene for table, scene, *_ in values if table == "IV"} == {"box"}
    assert "As in the paper, without" not in (tmp_path / "out" / "benchmark.md").read_text()


def test_a_table_says_which_recordings_the_papers_has_not(no_page, command, recordings, saved, tmp_path):
    saved(recordings / "boxes", background="box")
    assert main(command) == 0
    page = (tmp_path / "out" / "benchmark.md").read_text()
    assert page.count("As in the paper, without recordings of: boxes.") == page.count("As in the paper, without") == 1
    assert page.index("As in the paper, without") < page.index("## Table III")


def test_recordings_of_no_known_background_are_one_scene(runs, saved, tmp_path):
    saved(tmp_path / "mine" / "first", background=None)
    assert main(["benchmark", "--data", str(tmp_path / "mine"), "--out", str(tmp_path / "out"), *MODELS]) == 0
    assert values_in(tmp_path / "out")["II", "all recordings", "half", "iou"] == approx(50 / 140)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--minutes", "1"], "--minutes, --seed and --size are of simulated recordings"),
        (["--models", "unknown"], "no model 'unknown'"),
        (["--models", "half", "half"], "two models are called 'half'"),
        (["--empty-models"], "no model"),
    ],
)
def test_what_does_not_fit_is_one_error(words, said, runs, recordings, tmp_path, capsys):
    assert main(["benchmark", "--data", str(recordings), "--out", str(tmp_path / "out"), *words]) == 2
    assert said in capsys.readouterr().err
    assert not list((tmp_path / "out").glob("benchmark.*"))


def test_an_empty_folder_is_one_error(runs, tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    assert main(["benchmark", "--data", str(tmp_path / "empty"), "--out", str(tmp_path / "out"), *MODELS]) == 2
    assert "no recording with truth in" in capsys.readouterr().err


def test_an_unknown_model_is_refused_before_anything_is_simulated(runs, tmp_path, capsys):
    assert main(["benchmark", "--out", str(tmp_path / "out"), "--models", "unknown"]) == 2
    assert "no model 'unknown'" in capsys.readouterr().err
    assert not (tmp_path / "out" / "recordings").exists()
