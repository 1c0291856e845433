"""A realism report in words."""

import io

import numpy as np
import pytest
from rich.console import Console

from evimo.evaluation.event_statistics import EventStatistics
from evimo.evaluation.realism import MEASURES, Realism
from evimo.evaluation.realism_tables import as_markdown, as_rich, cells, heads, notes
from evimo.evaluation.statistics_kernel import INTERVAL_BINS


def statistics(name: str, *, width: int = 5, **values: float) -> EventStatistics:
    return EventStatistics(
        name=name,
        sensor=(4, width),
        slices=40,
        events=1234,
        hot_pixels=0,
        values={measure.name: None for measure in MEASURES} | values,
        intervals=np.zeros(INTERVAL_BINS, np.int64),
        counts=np.array([33, 7]),
        per_slice=np.full(40, 30),
    )


@pytest.fixture
def report() -> Realism:
    """Isolated events twice as often as allowed, ON fraction 0.1 below, the rest inside, shown or missing."""
    real = [statistics("street", isolated=0.1, on=0.5, rate=3.0, per_active=1.7)]
    made = [statistics("set1_000000", isolated=0.4, on=0.4, rate=9.0, per_active=1.8)]
    return Realism(real, made)


def line(report: Realism, name: str) -> list[str]:
    return cells(report)[[measure.name for measure in MEASURES].index(name)]


def test_a_line_has_a_cell_for_every_head(report):
    assert {len(cell) for cell in cells(report)} == {len(heads(report))}


def test_lines_say_range_tolerance_and_how_far_off(report):
    assert line(report, "isolated") == [
        *("isolated events Hz", "0.100", "0.100", "×2", "0.400", "0.400", "0.400", "0%", "OUTSIDE ×4.00")
    ]
    assert line(report, "on")[-1] == "OUTSIDE -0.10"
    assert line(report, "per_active")[-2:] == ["100%", "inside"]
    assert line(report, "rate")[-2:] == ["–", "scene"]
    assert line(report, "changes")[1:] == ["–", "–", "±0.1", "–", "–", "–", "–", "nothing to judge"]


def test_many_real_recordings_have_no_column_each():
    real = [statistics(str(number), on=0.4 + 0.02 * number) for number in range(6)]
    report = Realism(real, [statistics("made", on=0.5)])
    assert "5" not in heads(report)
    assert line(report, "on")[1] == "0.40–0.50"


def test_notes_count_what_was_read_and_what_gives_it_away(report):
    assert notes(report)[0] == "real: 1 recordings, 1.0 s in slices of 25 ms, 1,234 events"
    assert notes(report)[-1] == "2 of 3 statistics give the simulation away: ON fraction, isolated events"


def test_sensors_of_different_sizes_are_pointed_out(report):
    mixed = Realism(report.real, [statistics("large", width=50, on=0.5)])
    assert any("different sizes" in note for note in notes(mixed))
    assert not any("different sizes" in note for note in notes(report))


def test_the_page_has_every_measure_and_every_recording(report):
    page = as_markdown(report)
    assert all(page.count(measure.header) >= 2 for measure in MEASURES)
    assert "| real: street | 1.00 | 1,234 |" in page
    assert "| simulated: set1_000000 |" in page


def test_the_terminal_shows_the_same_cells(report):
    console = Console(width=150, record=True, file=io.StringIO())
    console.print(as_rich(report))
    assert "OUTSIDE ×4.00" in console.export_text()
