"""The result of an evaluation: adds up over slices and recordings, saves itself, prints through `tables`."""

import csv
import io
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from evimo.errors import BadFile, BadInput, NotFound
from evimo.evaluation import baselines
from evimo.evaluation.columns import COLUMNS, CONVENTIONS
from evimo.evaluation.ranked import Ranked, ranked_from
from evimo.evaluation.ratios import Score, Scores, added
from evimo.writing import save_text

Key = TypeVar("Key")

MODEL = "model"
LABELS = "model, its labels of events"
FORMAT = 4
"""Of report.json; grows when the meaning of a number changes, so that older files are not mixed with newer ones."""


@dataclass(frozen=True, slots=True)
class Report:
    """Scores of the model and of the trivial answers on the same slices.

    rows:     scores by the row's name, `MODEL` first.
    groups:   the model's scores once more by group, such as the kind of scene.
    ranked:   of rows with masks, what must be put in order over all slices before it is a number.
    density:  mask scores of each density threshold, from which the oracle row is made.
    counts:   what was scored and what was left out.
    settings: model, versions, thresholds: what the numbers depend on.
    """

    title: str = "recordings"
    rows: Mapping[str, Scores] = field(default_factory=dict[str, Scores])
    groups: Mapping[str, Scores] = field(default_factory=dict[str, Scores])
    ranked: Mapping[str, Ranked] = field(default_factory=dict[str, Ranked])
    density: Mapping[float, Scores] = field(default_factory=dict[float, Scores])
    counts: Mapping[str, int] = field(default_factory=dict[str, int])
    settings: Mapping[str, str | float] = field(default_factory=dict[str, str | float])

    def __add__(self, other: "Report") -> "Report":
        """Both as one; title and settings are those of the first."""
        counts = {key: self.counts.get(key, 0) + other.counts.get(key, 0) for key in {**self.counts, **other.counts}}
        return Report(
            self.title,
            rows=added_tables(self.rows, other.rows),
            groups=added_tables(self.groups, other.groups),
            ranked={
                row: self.ranked.get(row, Ranked()) + other.ranked.get(row, Ranked())
                for row in {**self.ranked, **other.ranked}
            },
            density=added_tables(self.density, other.density),
            counts=counts,
            settings=self.settings,
        )

    @property
    def table_rows(self) -> dict[str, Scores]:
        """The rows of the tables: `rows` with what is ranked, and where densities were scored the oracle threshold."""
        rows: dict[str, Scores] = {}
        for row in self.rows:
            rows[row] = self.scores_of(row)
            if row == baselines.DENSITY and self.density:
                best = baselines.best_threshold(dict(self.density))
                rows[f"{baselines.DENSITY_ORACLE} {best:.2f}"] = self.density[best]
        return rows

    def scores_of(self, row: str) -> Scores:
        """All scores of a row, those included for which all slices are put in order first."""
        ranked = self.ranked.get(row)
        return {**self.rows.get(row, {}), **(ranked.scores() if ranked else {})}

    def value(self, row: str, name: str) -> float | None:
        """One number of the table; None where nothing was scored."""
        score = self.scores_of(row).get(name)
        return score.value if score else None

    def as_dict(self) -> dict[str, Any]:
        """For JSON; `report_from` reads it back."""
        return {
            "format": FORMAT,
            "title": self.title,
            "settings": dict(self.settings),
            "counts": dict(self.counts),
            "rows": {row: plain(scores) for row, scores in self.rows.items()},
            "groups": {group: plain(scores) for group, scores in self.groups.items()},
            "ranked": {row: ranked.plain() for row, ranked in self.ranked.items()},
            "density": {str(key): plain(scores) for key, scores in self.density.items()},
            "conventions": list(CONVENTIONS),
        }

    def save(self, path: str | Path) -> None:
        """Write all sums and values as JSON; folders are made.

        Raises:
            BadInput: it cannot be written, or the disk is full.
        """
        save_text(self.as_json(), path)

    def as_json(self) -> str:
        """All sums and values, as `load_report` reads them back."""
        return json.dumps(self.as_dict(), indent=1, ensure_ascii=False) + "\n"

    def as_csv(self) -> str:
        """The values as a table: one line per row, empty where nothing was scored."""
        text = io.StringIO()
        writer = csv.writer(text)
        writer.writerow(["row", *(column.name for column in COLUMNS)])
        for row, scores in self.table_rows.items():
            values = (scores[column.name].value if column.name in scores else None for column in COLUMNS)
            writer.writerow([row, *("" if value is None else f"{value:.6g}" for value in values)])
        return text.getvalue()


def added_tables(first: Mapping[Key, Scores], second: Mapping[Key, Scores]) -> dict[Key, Scores]:
    """Two tables as one; a row that is missing in one adds nothing."""
    return {key: added((first.get(key, {}), second.get(key, {}))) for key in {**first, **second}}


def plain(scores: Scores) -> dict[str, dict[str, float | None]]:
    """Scores as JSON holds them; the value beside the sums is for people."""
    return {
        name: {"top": score.top, "bottom": score.bottom, "samples": score.samples, "value": score.value}
        for name, score in scores.items()
    }


def scores_from(saved: Mapping[str, Mapping[str, Any]]) -> Scores:
    """What `plain` made, read back."""
    return {name: Score(each["top"], each["bottom"], each["samples"]) for name, each in saved.items()}


def load_report(path: str | Path) -> Report:
    """A report saved by `Report.save`.

    Raises:
        NotFound: no such file.
        BadFile: not a report, or one of another format.
    """
    if not Path(path).is_file():
        raise NotFound(f"no report {str(path)!r}", fix="the report.json written by evimo evaluate --out")
    try:
        saved = json.loads(Path(path).read_text(encoding="utf-8"))
        if saved["format"] != FORMAT:
            raise BadFile(f"{path} has report format {saved['format']}, not {FORMAT}", fix="evaluate again")
        return Report(
            title=saved["title"],
            rows={row: scores_from(scores) for row, scores in saved["rows"].items()},
            groups={group: scores_from(scores) for group, scores in saved["groups"].items()},
            ranked={row: ranked_from(ranked) for row, ranked in saved["ranked"].items()},
            density={float(key): scores_from(scores) for key, scores in saved["density"].items()},
            counts=saved["counts"],
            settings=saved["settings"],
        )
    except (ValueError, KeyError, TypeError, AttributeError, BadInput) as error:
        raise BadFile(f"{path} is not a report: {error}", fix="the report.json written by evimo evaluate") from error
