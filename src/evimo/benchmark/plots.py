"""The plots of a benchmark as SVG: how masks, depth and motion depend on what is seen."""

import io
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from evimo.benchmark.curves import DEPTH, EDGES, LEVELS, PRECISION, RECALL, SPEED, TURNING
from evimo.benchmark.result import Result
from evimo.benchmark.scenes import SCENES
from evimo.benchmark.scoring import TRIVIAL
from evimo.evaluation.baselines import CONSTANT_DEPTH, DENSITY, ZERO_TWIST
from evimo.evaluation.ratios import Scores
from evimo.evaluation.report import MODEL
from evimo.evaluation.strata import AREAS, RESIDUALS
from evimo.writing import in_utf8

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = ("#1b5fc1", "#0f9d8a", "#e08a1e", "#8e5bd0", "#d1495b", "#5c6b7a")
"""Of the models in their order; told apart by lightness, too."""
MARKERS = "osD^vP"
GREY, RULE, INK = "#8a929c", "#e3e6ea", "#20262e"
HALF = LEVELS // 2
BEYOND = " The first and the last point hold everything beyond them."
STYLE: dict[Any, Any] = {
    "text.parse_math": False,  # names of files and models are no formulas
    "svg.fonttype": "none",  # text stays text: it can be searched, and the page's font is used
    "font.family": "sans-serif",
    "font.sans-serif": ["Inter", "Helvetica Neue", "Arial", "DejaVu Sans"],
    "font.size": 10,
    "text.color": INK,
    "axes.edgecolor": GREY,
    "axes.labelcolor": INK,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": RULE,
    "xtick.color": INK,
    "ytick.color": INK,
    "legend.frameon": False,
}


@dataclass(frozen=True, slots=True)
class Plot:
    """One plot. caption: what it shows. svg: to be put into a page. wide: over its whole width."""

    title: str
    caption: str
    svg: str
    wide: bool = False


def plots_of(result: Result) -> list[Plot]:
    """Every plot for which something was scored."""
    candidates = [_precision_recall(result), *_over_movers(result), *_over_bins(result), _by_sequence(result)]
    return [plot for plot in candidates if plot is not None]


def _precision_recall(result: Result) -> Plot | None:
    lines = {model: result.total(model).curves for model in result.models}
    lines = {model: curves for model, curves in lines.items() if PRECISION in curves}
    trivial = result.total(TRIVIAL).curves
    dense = {name: trivial.get(f"{DENSITY}: {name}", {}) for name in (PRECISION, RECALL)}

    def draw(axes: "Axes") -> None:
        if dense[PRECISION]:
            recall, precision = _pairs(dense)
            axes.plot(recall, precision, color=GREY, linestyle="--", label="event density")
        for k, (model, curves) in enumerate(lines.items()):
            colour = _colour(result, model)
            recall, precision = _pairs(curves)
            axes.plot(recall, precision, color=colour, label=_label(model), linewidth=1.8)
            at = [curves[name][str(HALF)].value or 0 for name in (RECALL, PRECISION)]
            axes.plot(*at, color=colour, marker=MARKERS[k % len(MARKERS)], markersize=7)
        axes.set(xlabel="recall", ylabel="precision", xlim=(0, 1), ylim=(0, 1.02))
        _legend(axes)

    caption = "Moving pixels, pooled over all scored pixels; the marks are at the threshold of ½ that all tables use."
    return _plot("Precision and recall", caption, draw) if lines else None


def _pairs(curves: Mapping[str, Scores]) -> tuple[list[float], list[float]]:
    """Recall and precision of each threshold at which anything is called moving."""
    found = [
        (recall, precision)
        for k in range(LEVELS)
        if (precision := curves[PRECISION][str(k)].value) is not None
        and (recall := curves[RECALL][str(k)].value) is not None
    ]
    return [recall for recall, _ in found], [precision for _, precision in found]


def _over_movers(result: Result) -> Iterator[Plot]:
    speeds = "IoU over the movers' speed", "speed against the static world, per slice of 25 ms"
    areas = "IoU over the movers' area", "share of the scored pixels"
    for (title, label), strata in ((speeds, RESIDUALS), (areas, AREAS)):
        scores = {model: result.total(model).rows.get(MODEL, {}) for model in result.models}
        values = {
            model: [each[f"iou_{name}"].value if f"iou_{name}" in each else None for name in strata]
            for model, each in scores.items()
        }
        shown = {model: each for model, each in values.items() if any(value is not None for value in each)}
        if shown:
            yield _stratified(result, title, label, list(strata.values()), shown)


def _stratified(
    result: Result, title: str, label: str, words: Sequence[str], values: Mapping[str, Sequence[float | None]]
) -> Plot:
    def draw(axes: "Axes") -> None:
        for k, (model, each) in enumerate(values.items()):
            known = [(at, value) for at, value in enumerate(each) if value is not None]
            axes.plot(
                *zip(*known, strict=True),
                color=_colour(result, model),
                marker=MARKERS[k % len(MARKERS)],
                label=_label(model),
            )
        axes.set_xticks(range(len(words)), words)
        axes.set(xlabel=label, ylabel="IoU", ylim=(0, 1))
        _legend(axes)

    caption = "Mean over the frames that show such a mover; pixels of other movers are left out."
    return _plot(title, caption, draw)


def _over_bins(result: Result) -> Iterator[Plot | None]:
    yield _binned(
        result,
        DEPTH,
        trivial=CONSTANT_DEPTH,
        words=("Depth error over depth", "true depth, m", "mean |error| / true depth"),
        caption="Pixels by their true depth, each frame at its median scale; one depth is right at one depth." + BEYOND,
    )
    yield _binned(
        result,
        TURNING,
        trivial=ZERO_TWIST,
        words=("Rotation error over rotation", "how fast the camera turns, rad/s", "RRE, rad/s"),
        caption="Slices by the true rotation of the camera; above the dashed line, saying nothing is better." + BEYOND,
    )
    yield _binned(
        result,
        SPEED,
        trivial=ZERO_TWIST,
        words=("Velocity error over speed", "how fast the camera moves, m/s", "AEE at the scale of the depths, m/s"),
        caption="Slices by the true speed of the camera; above the dashed line, saying nothing is better." + BEYOND,
    )


def _binned(result: Result, name: str, *, trivial: str, words: tuple[str, str, str], caption: str) -> Plot | None:
    edges = np.array(EDGES[name])
    middles = (edges[1:] + edges[:-1]) / 2
    curves = {model: result.total(model).curves.get(name, {}) for model in result.models}
    curves = {model: curve for model, curve in curves.items() if curve}
    nothing = result.total(TRIVIAL).curves.get(f"{ZERO_TWIST}: {name}", {})

    def points(curve: Scores) -> tuple[list[float], list[float]]:
        known = [
            (float(middles[int(k)]), value) for k in sorted(curve, key=int) if (value := curve[k].value) is not None
        ]
        return [x for x, _ in known], [y for _, y in known]

    def draw(axes: "Axes") -> None:
        axes.plot(
            *points(nothing), color=GREY, linestyle="--", label=trivial, zorder=3
        )  # seen where models are no better
        for k, (model, curve) in enumerate(curves.items()):
            axes.plot(
                *points(curve), color=_colour(result, model), marker=MARKERS[k % len(MARKERS)], label=_label(model)
            )
        axes.set(xlabel=words[1], ylabel=words[2], ylim=(0, None), xlim=(0, None))
        _legend(axes)

    return _plot(words[0], caption, draw) if curves else None


def _by_sequence(result: Result) -> Plot | None:
    values = {
        model: [result.of_sequence(model, sequence).get("iou") for sequence in result.ordered]
        for model in result.models
    }
    shown = [k for k in range(len(result.ordered)) if any(each[k] is not None for each in values.values())]
    if not shown:
        return None
    scenes = [result.ordered[k].scene for k in shown]

    def draw(axes: "Axes") -> None:
        for k, (model, each) in enumerate(values.items()):
            known = [(at, value) for at, k_ in enumerate(shown) if (value := each[k_]) is not None]
            axes.plot(
                *zip(*known, strict=True),
                color=_colour(result, model),
                marker=MARKERS[k % len(MARKERS)],
                linestyle="none",
                markersize=6,
                alpha=0.9,
                label=_label(model),
            )
        starts = [at for at, scene in enumerate(scenes) if at == 0 or scene != scenes[at - 1]]
        for start, stop in zip(starts, [*starts[1:], len(scenes)], strict=True):
            title = SCENES[scenes[start]].title if scenes[start] in SCENES else scenes[start]
            axes.text((start + stop - 1) / 2, 1.04, title, ha="center", fontweight="bold")
            axes.axvline(start - 0.5, color=GREY, linewidth=0.8 if start else 0)
        axes.set_xticks(range(len(shown)), [_short(result.ordered[k].name) for k in shown], rotation=90, fontsize=7)
        axes.set(ylabel="IoU", ylim=(0, 1), xlim=(-0.5, len(shown) - 0.5))
        axes.grid(visible=False, axis="x")
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))

    caption = "Mean over each sequence's frames with movers: the average of a table hides how far sequences lie apart."
    return _plot("IoU by sequence", caption, draw, wide=True)


def _short(name: str) -> str:
    return in_utf8(name.rsplit("/", 1)[-1].removesuffix(".npz"))


def _legend(axes: "Axes") -> None:
    """Above the plot, where it hides nothing."""
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3, borderaxespad=0.2)


def _label(model: str) -> str:
    """The name in a legend, which leaves out whatever begins with an underscore."""
    return f"\u200b{model}" if model.startswith("_") else model


def _colour(result: Result, model: str) -> str:
    return COLOURS[result.models.index(model) % len(COLOURS)]


def _plot(title: str, caption: str, draw: Callable[["Axes"], None], *, wide: bool = False) -> Plot:
    """Draw on a figure of its own: pyplot would keep it, and may want a window."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context({**STYLE, "svg.hashsalt": title}):  # same numbers, same file; ids differ from plot to plot
        figure = Figure(figsize=(11, 3.9) if wide else (5.4, 3.9), layout="constrained")
        draw(figure.add_subplot())
        file = io.StringIO()
        figure.savefig(file, format="svg", transparent=True, metadata={"Date": None})
    return Plot(title, caption, _inline(file.getvalue(), title), wide)


def _inline(svg: str, title: str) -> str:
    """The drawing alone, as wide as its place; named for those who cannot see it."""
    drawing = svg[svg.index("<svg") :]
    drawing = re.sub(r' (?:width|height)="[\d.]+pt"', "", drawing, count=2)
    return drawing.replace("<svg", f'<svg role="img" aria-label="{title}"', 1)
