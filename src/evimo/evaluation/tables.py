"""A report as tables: for the terminal with rich, for a page as Markdown."""

from collections.abc import Iterator

from rich.box import SIMPLE
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from evimo.evaluation.column import Column
from evimo.evaluation.columns import BY_NAME, COLUMNS, CONVENTIONS, OVERVIEW, PROTOCOLS_SECTION, SECTIONS
from evimo.evaluation.protocol_tables import protocol_heads, protocol_lines, spread
from evimo.evaluation.ratios import Score
from evimo.evaluation.report import MODEL, Report

ARROWS = {"higher": "↑", "lower": "↓"}


def header(column: Column, *, between: str = " ") -> str:
    """Name, movers meant, unit and which way is better."""
    return between.join(part for part in (column.header, column.of, column.unit, ARROWS[column.better]) if part)


def definition(column: Column) -> str:
    """What the column is, for a page: name, unit, meaning; one text for all kinds of movers it is told apart by."""
    name = f"{column.header} of such movers" if column.of else column.header
    return f"**{name}**{f' [{column.unit}]' if column.unit else ''}: {column.meaning}"


def cell(score: Score | None, column: Column) -> str:
    """The number as printed; a dash where nothing was scored."""
    value = score.value if score else None
    return "–" if value is None else f"{value:.{column.digits}f}"


def shown(report: Report, sections: tuple[str, ...]) -> list[str]:
    """The sections of which anything was scored, for any row; all of them where nothing at all was scored."""
    scored = {name for scores in report.rows.values() for name in scores}
    return [section for section in sections if not scored or scored.intersection(SECTIONS[section])]


def cells(report: Report, section: str) -> list[list[str]]:
    """The rows of one section, each its name and its cells; rows without any number are left out; last, the samples."""
    columns = [BY_NAME[name] for name in SECTIONS[section]]
    rows = report.table_rows
    if section == OVERVIEW:
        rows |= {f"{MODEL}, {group}": scores for group, scores in sorted(report.groups.items())}
    lines = [
        [row, *(cell(scores.get(column.name), column) for column in columns)]
        for row, scores in rows.items()
        if any(column.name in scores for column in columns)
    ]
    model = report.scores_of(MODEL)
    samples = [str(model[column.name].samples) if column.name in model else "0" for column in columns]
    return [*lines, ["samples kept (slices or objects)", *samples]]


def notes(report: Report) -> Iterator[str]:
    """What was counted and left out, and whether the model beats zero motion."""
    yield ", ".join(f"{count:,} {what}" for what, count in report.counts.items())
    yield ", ".join(f"{what}: {value}" for what, value in report.settings.items())
    yield spread(report) or ""
    for name, what in (
        ("flow_ratio", "zero flow"),
        ("flow_movers_ratio", "zero flow on movers"),
        ("aee_ratio", "zero twist (AEE)"),
        ("aee_depth_ratio", "zero twist (AEE, depth)"),
        ("rre_ratio", "zero twist (RRE)"),
    ):
        if (ratio := report.value(MODEL, name)) is not None:
            yield f"{'beats' if ratio < 1 else 'DOES NOT BEAT'} {what}: {ratio:.2f} of its error"


def as_rich(report: Report, *, sections: tuple[str, ...] = tuple(SECTIONS)) -> RenderableType:
    """Tables and notes for a rich console."""
    parts: list[RenderableType] = []
    for section in shown(report, sections):
        table = Table(title=f"{report.title}: {section}", title_justify="left", box=SIMPLE, padding=(0, 1, 0, 0))
        parts.append(table)
        if section == PROTOCOLS_SECTION:
            _fill_with_protocols(table, report)
            continue
        table.add_column("", no_wrap=True)
        for name in SECTIONS[section]:
            table.add_column(Text(header(BY_NAME[name], between="\n")), justify="right")
        *lines, samples = cells(report, section)
        for line in lines:
            table.add_row(*line, style="bold" if line[0] == MODEL else None)
        table.add_section()
        table.add_row(*samples, style="dim")
    return Group(*parts, *(Text(note) for note in notes(report) if note))


def _fill_with_protocols(table: Table, report: Report) -> None:
    heads, lines = protocol_heads(report), protocol_lines(report)
    for head in heads:
        justify = "right" if head in (*report.rows, "kept") else "left"
        table.add_column(Text(head.replace(", ", ",\n")), justify=justify, no_wrap=head == heads[0])
    for line in lines:
        table.add_row(*line)


def as_markdown(report: Report) -> str:
    """The whole report as a page: tables, notes, what each column means, conventions."""
    lines = [f"# {report.title}", "", *(f"- {note}" for note in notes(report) if note)]
    for section in shown(report, tuple(SECTIONS)):
        if section == PROTOCOLS_SECTION:
            heads = protocol_heads(report)
            lines += ["", f"## {section}", "", table_line(heads), table_line(["---"] * len(heads))]
            lines += [table_line(line) for line in protocol_lines(report)]
            continue
        names = SECTIONS[section]
        heads = ["", *(header(BY_NAME[name]) for name in names)]
        lines += ["", f"## {section}", "", table_line(heads), table_line(["---", *["---:"] * len(names)])]
        lines += [table_line(line) for line in cells(report, section)]
    lines += ["", "## what the columns are", ""]
    lines += [f"- {text}" for text in dict.fromkeys(map(definition, COLUMNS))]
    lines += ["", "## conventions", "", *(f"- {convention}" for convention in CONVENTIONS), ""]
    return "\n".join(lines)


def table_line(parts: list[str]) -> str:
    """One line of a Markdown table; a bar in a name of a file is none of the table's."""
    escaped = (part.replace("|", "\\|") for part in parts)
    return f"| {' | '.join(escaped)} |"
