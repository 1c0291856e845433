"""Reports add up, print and are read back as they were saved."""

import csv
import json

import pytest
from pytest import approx
from rich.console import Console

from evimo.errors import BadFile, NotFound
from evimo.evaluation import baselines
from evimo.evaluation.columns import BY_NAME, COLUMNS, SECTIONS
from evimo.evaluation.ratios import Score
from evimo.evaluation.report import MODEL, Report, load_report
from evimo.evaluation.scores import mask_scores
from evimo.evaluation.tables import as_markdown, as_rich, table_line
from evimo.writing import save_text


def report_of(sample, mask) -> Report:
    density = baselines.density_scores(sample, (1.0, 2.0))
    rows = {MODEL: mask_scores(mask, sample), **baselines.trivial_scores(sample), baselines.DENSITY: density[1.0]}
    return Report(
        "simulated recordings",
        rows,
        groups={"set 1": rows[MODEL]},
        density=density,
        counts={"slices": 1},
        settings={"model": "hand made", "density threshold": 3.0},
    )


@pytest.fixture
def report(sample, still_sample, box) -> Report:
    """One slice with a mover, and one without; the mask overlaps half."""
    return report_of(sample, box(1, 3, 2, 5)) + report_of(still_sample, box(0, 6, 0, 4))


def test_a_sum_of_reports_is_the_report_of_all_slices(report):
    assert report.counts["slices"] == 2
    assert report.value(MODEL, "iou") == approx(4 / 8)  # the frame without movers is left out of the mean
    assert report.value(MODEL, "iou_pooled") == approx(4 / (8 + 24))
    assert report.value(MODEL, "false_alarm_events") == approx(2 / 4)
    assert report.rows[MODEL]["iou"].samples == 1
    assert report.rows[MODEL]["iou_pooled"].samples == 2
    assert report.value(MODEL, "abs_rel") is None


def test_adding_to_an_empty_report_changes_no_number(report):
    assert (Report() + report).rows == report.rows
    assert (report + Report()) == report


def test_what_was_saved_is_read_back(report, tmp_path):
    report.save(tmp_path / "deep" / "report.json")
    assert load_report(tmp_path / "deep" / "report.json") == report
    assert json.loads((tmp_path / "deep" / "report.json").read_text())["conventions"]


def test_csv_has_a_line_per_row_and_leaves_unknowns_empty(report, tmp_path):
    save_text(report.as_csv(), tmp_path / "report.csv")
    lines = list(csv.DictReader((tmp_path / "report.csv").open()))
    assert [line["row"] for line in lines] == list(report.table_rows)
    assert float(lines[0]["iou"]) == approx(0.5)
    assert lines[0]["abs_rel"] == ""


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"format": 99}', '{"format": 4, "title": "x", "rows": {"a": 1}}'])
def test_other_files_are_refused(content, tmp_path):
    (tmp_path / "report.json").write_text(content)
    with pytest.raises(BadFile):
        load_report(tmp_path / "report.json")


def test_a_missing_report_is_said_to_be_missing(tmp_path):
    with pytest.raises(NotFound, match="no report"):
        load_report(tmp_path / "report.json")


def test_tables_hold_every_row_and_the_numbers(report):
    console = Console(width=220, record=True, file=None, quiet=True)
    console.print(as_rich(report))
    page = as_markdown(report)
    assert "# simulated recordings" in page
    for row in (MODEL, baselines.ALL_BACKGROUND, baselines.EVERYTHING, baselines.CONSTANT_DEPTH, baselines.ZERO_FLOW):
        assert f"| {row} |" in page
    assert "| model | 0.500 |" in page and "| model, set 1 | 0.500 |" in page
    assert "## by area" in page and "## objects seen in training" not in page  # nobody says which are
    assert page.count("- **IoU of such movers**: ") == 1
    assert "2 slices" in page and "model: hand made" in page
    assert list(report.table_rows)[-1].startswith(baselines.DENSITY_ORACLE)
    assert baselines.DENSITY_ORACLE in page


def test_a_model_worse_than_zero_is_told_so():
    better = Report(rows={MODEL: {"flow_ratio": Score(8, 10), "rre_ratio": Score(13, 10)}})
    page = as_markdown(better)
    assert "beats zero flow: 0.80" in page
    assert "DOES NOT BEAT zero twist (RRE): 1.30" in page


def test_every_score_has_a_column_and_every_column_is_shown(big_sample):
    shown = {name for names in SECTIONS.values() for name in names}
    assert shown == set(BY_NAME)
    assert len(BY_NAME) == len(COLUMNS)
    trivial = baselines.trivial_scores(big_sample).values()
    assert {name for scores in trivial for name in scores} <= shown


def test_a_bar_in_a_name_does_not_end_the_cell():
    assert table_line(["a|b", "1"]) == "| a\\|b | 1 |"
