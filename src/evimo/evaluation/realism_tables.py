"""A realism report as tables: for the terminal with rich, for a page as Markdown."""

from rich.box import SIMPLE
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from evimo.evaluation.realism import Measure, Realism, Verdict
from evimo.evaluation.tables import table_line

MOST_COLUMNS, LONGEST_NAME = 4, 12
"""Real recordings with a column each; of more, only the range is shown in the overview."""

NO_VERDICT = "scene"

HOW_TO_READ = """\
The range of the real recordings is widened by the tolerance; `OUTSIDE` says how far the simulated recordings' median
lies from the range itself, as a ratio or a difference. Rows marked `scene` depend on the scene and on how the camera
moves and are not judged; the others depend on them less. Isolated events are noise where the camera stands still and
mostly weak texture where it moves: compare like with like."""


def heads(realism: Realism) -> list[str]:
    """The header of the overview."""
    names = [each.name[:LONGEST_NAME] for each in realism.real] if len(realism.real) <= MOST_COLUMNS else []
    return ["", *names, "real range", "tolerance", "simulated p10", "median", "p90", "inside", "verdict"]


def cells(realism: Realism) -> list[list[str]]:
    """One line for each measure."""
    shown = len(realism.real) <= MOST_COLUMNS
    lines: list[list[str]] = []
    for verdict in realism.verdicts:
        measure = verdict.measure
        ends = (verdict.low,) if verdict.low == verdict.high else (verdict.low, verdict.high)
        share = "–" if verdict.recordings_inside is None else f"{verdict.recordings_inside:.0%}"
        lines.append(
            [
                " ".join(part for part in (measure.header, measure.unit) if part),
                *(number(measure, value) for value in (verdict.real if shown else ())),
                "–".join(number(measure, end) for end in ends),
                measure.tolerance,
                *(number(measure, value) for value in (verdict.p10, verdict.median, verdict.p90)),
                share,
                words(verdict),
            ]
        )
    return lines


def words(verdict: Verdict) -> str:
    """The verdict, and how far off the median lies from the range."""
    if not verdict.measure.judged:
        return NO_VERDICT
    if verdict.inside is None:
        return "nothing to judge"
    if verdict.inside:
        return "inside"
    off = "" if verdict.off is None else f"×{verdict.off:.2f}" if verdict.measure.factor else f"{verdict.off:+.2f}"
    return f"OUTSIDE {off}".rstrip()


def notes(realism: Realism) -> list[str]:
    """What was read and what the verdict is."""
    judged = sum(verdict.inside is not None for verdict in realism.verdicts)
    outside = [verdict.measure.header for verdict in realism.outside]
    lines = [
        f"{kind}: {len(those)} recordings, {sum(each.seconds for each in those):.1f} s in slices of 25 ms, "
        f"{sum(each.events for each in those):,} events"
        for kind, those in (("real", realism.real), ("simulated", realism.simulated))
    ]
    if len({each.sensor for each in (*realism.real, *realism.simulated)}) > 1:
        lines.append("sensors of different sizes: speeds in px/s, and with them intervals and counts, may differ")
    said = f": {', '.join(outside)}" if outside else ""
    return [*lines, f"{len(outside)} of {judged} statistics give the simulation away{said}"]


def as_rich(realism: Realism) -> RenderableType:
    """The overview and the notes for a rich console."""
    table = Table(title="real and simulated events", title_justify="left", box=SIMPLE, padding=(0, 1, 0, 0))
    for head in heads(realism):
        table.add_column(Text(head), justify="right" if head else "left")
    for verdict, line in zip(realism.verdicts, cells(realism), strict=True):
        table.add_row(*line, style="bold red" if verdict.inside is False else None if verdict.measure.judged else "dim")
    return Group(table, *(Text(note) for note in notes(realism)))


def as_markdown(realism: Realism) -> str:
    """The report as a page: overview, each recording, what the rows mean."""
    first = heads(realism)
    lines = ["# real and simulated events", "", *(f"- {note}" for note in notes(realism)), ""]
    lines += [table_line(first), table_line(["---", *["---:"] * (len(first) - 1)])]
    lines += [table_line(line) for line in cells(realism)]
    measures = [verdict.measure for verdict in realism.verdicts]
    columns = ["recording", "s", "events", *(measure.header for measure in measures)]
    lines += ["", "## each recording", "", table_line(columns), table_line(["---", *["---:"] * (len(columns) - 1)])]
    for kind, those in (("real", realism.real), ("simulated", realism.simulated)):
        for each in those:
            values = [number(measure, each.values[measure.name]) for measure in measures]
            lines.append(table_line([f"{kind}: {each.name}", f"{each.seconds:.2f}", f"{each.events:,}", *values]))
    lines += ["", "## what the rows are", ""]
    lines += [
        f"- **{measure.header}**{f' [{measure.unit}]' if measure.unit else ''}: {measure.meaning}"
        for measure in measures
    ]
    return "\n".join([*lines, "", HOW_TO_READ, ""])


def number(measure: Measure, value: float | None) -> str:
    """As printed; a dash where there is none."""
    return "–" if value is None else f"{value:.{measure.digits}f}"
