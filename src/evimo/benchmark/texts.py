"""A finished benchmark as Markdown, CSV and JSON."""

import csv
import io
import json
from collections.abc import Iterator
from typing import Any

from evimo.benchmark.orders import verdicts
from evimo.benchmark.paper import ON, PaperTable
from evimo.benchmark.result import Result
from evimo.benchmark.tables import Block, ResultTable, Row, value_of
from evimo.evaluation.column import Column
from evimo.evaluation.report import plain
from evimo.evaluation.tables import definition, header, table_line

SIMULATED = (
    "{which} these numbers are measured on simulated recordings. They are not comparable with numbers that others have"
    " measured on the real EV-IMO, which stand under headings of their own."
)
BEST = (
    "Bold is the best model, where it is better than every trivial answer. A dash: it does not say this, or there was"
    " nothing to score."
)


def notice(result: Result) -> str:
    """What a reader has to know of simulated recordings; nothing where there are none."""
    every = result.simulated == len(result.sequences)
    which = "All of" if every else f"{result.simulated} of {len(result.sequences)} recordings are simulated: some of"
    return SIMULATED.format(which=which) if result.simulated else ""


def as_markdown(result: Result) -> str:
    """The whole benchmark as a page of text."""
    lines = [f"# {result.title}", ""]
    lines += [notice(result), ""] if result.simulated else []
    for table in result.tables:
        lines += [f"## Table {table.layout.key}. {table.layout.title}", "", f"{table.about} {BEST}", ""]
        lines += _our_table(table)
        lines += [
            "",
            f"### The paper's numbers, for Table {table.layout.key}",
            "",
            f"{table.layout.paper.title}, {ON}.",
            "",
        ]
        lines += [*_paper_table(table.layout.paper), ""]
    if said := list(verdicts(result.tables)):
        lines += ["## Expected orders", "", *(f"- {each}" for each in said), ""]
    lines += ["## How it was measured", "", *(f"- **{name}**: {value}" for name, value in result.facts.items()), ""]
    columns = dict.fromkeys(column for table in result.tables for column in table.columns)
    lines += ["## What the columns are", "", *(f"- {definition(column)}" for column in columns), ""]
    lines += ["## Conventions", "", *(f"- {convention}" for convention in result.conventions), ""]
    return "\n".join(lines)


def _our_table(table: ResultTable) -> Iterator[str]:
    yield table_line(["scene", "", *(header(column) for column in table.columns)])
    yield table_line(["---", "---", *["---:"] * len(table.columns)])
    for block in table.blocks:
        for row in block.rows:
            name = {"model": row.name, "trivial": f"*{row.name}*", "ceiling": f"*{row.name} (ceiling)*"}[row.kind]
            yield table_line([block.title, name, *(_marked(block, row, column) for column in table.columns)])
        yield table_line([block.title, "samples kept", *(f"{block.kept(column):,}" for column in table.columns)])


def _marked(block: Block, row: Row, column: Column) -> str:
    text = cell(row, column)
    return f"**{text}**" if row.kind == "model" and row.name in block.best(column) else text


def cell(row: Row, column: Column) -> str:
    """The number as printed; a dash where nothing was scored."""
    value = value_of(row, column)
    return "–" if value is None else f"{value:.{column.digits}f}"


def _paper_table(paper: PaperTable) -> Iterator[str]:
    yield table_line(["scene", "", *paper.heads])
    yield table_line(["---", "---", *["---:"] * len(paper.heads)])
    yield from (table_line(list(line)) for line in paper.lines)


def as_csv(result: Result) -> str:
    """Every number of our own tables on a line of its own; none of the paper's."""
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(["table", "scene", "row", "kind", "score", "unit", "value", "samples"])
    for table in result.tables:
        for block in table.blocks:
            for row in block.rows:
                for column in table.columns:
                    if (value := value_of(row, column)) is not None:
                        about = (table.layout.key, block.scene, row.name, row.kind, column.name, column.unit)
                        writer.writerow([*about, f"{value:.6g}", row.scores[column.name].samples])
    return text.getvalue()


def as_json(result: Result) -> str:
    """Everything: tables, sums of all scores by scene, curves, numbers of each sequence; the paper's apart."""
    content: dict[str, Any] = {
        "title": result.title,
        "simulated": result.simulated > 0,
        "facts": result.facts,
        "conventions": list(result.conventions),
        "tables": {table.layout.key: [_block(block) for block in table.blocks] for table in result.tables},
        "orders": list(verdicts(result.tables)),
        "curves": {
            rival.name: {name: plain(scores) for name, scores in result.total(rival.name).curves.items()}
            for rival in result.rivals
        },
        "sequences": [
            {
                "name": sequence.name,
                "scene": sequence.scene,
                "seed": sequence.recording.meta.get("seed"),
                "models": {model: dict(result.of_sequence(model, sequence)) for model in result.models},
            }
            for sequence in result.ordered
        ],
        "paper": {"measured on": ON, "tables": [_paper(table.layout.paper) for table in result.tables]},
    }
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def _block(block: Block) -> dict[str, Any]:
    rows = [{"row": row.name, "kind": row.kind, "scores": plain(row.scores)} for row in block.rows]
    return {"scene": block.scene, "title": block.title, "rows": rows}


def _paper(paper: PaperTable) -> dict[str, Any]:
    return {
        "title": paper.title,
        "heads": ["scene", "method", *paper.heads],
        "lines": [list(line) for line in paper.lines],
    }
