"""The table of published protocols: one line each, what it is beside what the rows score."""

from evimo.evaluation.baselines import DENSITY, EVERYTHING
from evimo.evaluation.columns import PROTOCOLS
from evimo.evaluation.ratios import Score, Scores
from evimo.evaluation.report import LABELS, MODEL, Report

ROWS = (MODEL, LABELS, EVERYTHING, DENSITY)
IOUS = ("iou", "event_iou")  # how the names of scores begin that are IoUs of movers against the rest


def protocol_heads(report: Report) -> list[str]:
    """The heads of the table's columns; rows without any of these scores have none."""
    return ["protocol", *_rows(report), "kept", "of what", "window", "of which slices", "used by"]


def protocol_lines(report: Report) -> list[list[str]]:
    """One line for each protocol by which anything was scored; `kept` counts what is in the first number."""
    scores = {row: report.scores_of(row) for row in _rows(report)}
    lines: list[list[str]] = []
    for protocol in PROTOCOLS:
        name = protocol.column.name
        found = [each[name] for each in scores.values() if name in each]
        if found:
            values = [_shown(each, name) for each in scores.values()]
            window = protocol.window or "–"
            about = (str(found[0].samples), protocol.support, window, protocol.kept, protocol.source)
            lines.append([protocol.name, *values, *about])
    return lines


def spread(report: Report) -> str | None:
    """How far the IoUs of one row lie apart from protocol to protocol, in words; None where there are not two."""
    for row in (MODEL, LABELS):
        scores = report.scores_of(row)
        values = {
            protocol.name: value
            for protocol in PROTOCOLS
            if protocol.column.name.startswith(IOUS) and (value := _value(scores.get(protocol.column.name))) is not None
        }
        if len(values) > 1:
            low, high = min(values, key=values.__getitem__), max(values, key=values.__getitem__)
            return f"IoU of {row} by protocol: {values[low]:.3f} ({low}) to {values[high]:.3f} ({high})"
    return None


def _rows(report: Report) -> list[str]:
    names = {protocol.column.name for protocol in PROTOCOLS}
    return [row for row in ROWS if names.intersection(report.rows.get(row, {}))]


def _shown(scores: Scores, name: str) -> str:
    value = _value(scores.get(name))
    return "–" if value is None else f"{value:.3f}"


def _value(score: Score | None) -> float | None:
    return score.value if score else None
