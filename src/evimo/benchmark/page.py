"""A finished benchmark as one page that needs nothing else: no script, no network, plots and pictures inside."""

import base64
from pathlib import Path
from typing import Any

from evimo.benchmark.orders import verdicts
from evimo.benchmark.paper import ON
from evimo.benchmark.plots import plots_of
from evimo.benchmark.result import Result
from evimo.benchmark.scoring import TRIVIAL
from evimo.benchmark.texts import BEST, cell, notice
from evimo.benchmark.worst import FALSE, HIT, MISSED, WorstCase, as_png
from evimo.evaluation.tables import ARROWS
from evimo.viewing.colours import RGB

TEMPLATE = "page.html.jinja"


def as_html(result: Result) -> str:
    """The page."""
    from jinja2 import Environment, StrictUndefined

    source = (Path(__file__).parent / TEMPLATE).read_text(encoding="utf-8")
    template = Environment(autoescape=True, undefined=StrictUndefined).from_string(source)
    return template.render(
        result=result,
        lead=_lead(result),
        notice=notice(result),
        best=BEST,
        on=ON,
        arrows=ARROWS,
        cell=cell,
        orders=list(verdicts(result.tables)),
        plots=plots_of(result),
        cases=[_case(worst) for worst in result.worst],
        columns=list(dict.fromkeys(column for table in result.tables for column in table.columns)),
        hit=_css(HIT),
        missed=_css(MISSED),
        wrong=_css(FALSE),
    )


def _lead(result: Result) -> str:
    slices = sum(tally.counts.get("slices", 0) for tally in result.by_scene[TRIVIAL].values())
    models = ", ".join(result.models)
    truth = "exact truth" if result.simulated == len(result.sequences) else "the truth of the recordings"
    return (
        f"{len(result.sequences)} recordings, {slices:,} slices of 25 ms. Models: {models}. Measured by evimo benchmark"
        f" against {truth}, on the same slices and pixels for every row."
    )


def _case(worst: WorstCase) -> dict[str, Any]:
    return {
        "image": base64.b64encode(as_png(worst.picture)).decode(),
        "sequence": worst.sequence,
        "start_s": worst.frame.start_us / 1e6,
        "iou": worst.frame.iou,
        "wrong_px": worst.frame.wrong_px,
    }


def _css(colour: RGB) -> str:
    return "#" + "".join(f"{value:02x}" for value in colour)
