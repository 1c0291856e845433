"""`evimo benchmark`: the paper's tables of every model, with a page that shows them."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter
from rich.box import SIMPLE
from rich.table import Table
from rich.text import Text

from evimo.benchmark import running
from evimo.benchmark.cases import rivals_of
from evimo.benchmark.orders import verdicts
from evimo.benchmark.result import Result
from evimo.benchmark.tables import ResultTable
from evimo.benchmark.texts import cell
from evimo.cli.progress import progress
from evimo.cli.simulate import SIMULATING, pixels_of
from evimo.cli.streams import console
from evimo.errors import BadInput, check_installed
from evimo.evaluation.tables import header
from evimo.jobs.crew import ALONE, Crew
from evimo.writing import make_folder

if TYPE_CHECKING:
    from evimo.simulate.benchmark_set import BenchmarkPlan

SEED = 71_000_000
"""Of the first recording; training and choosing weights have had others."""
MINUTES = 5.0
SIMULATES = "--minutes, --seed and --size"
WIDTH = 110


def benchmark(
    *,
    out: Path,
    minutes: float | None = None,
    models: Annotated[tuple[str, ...], Parameter(consume_multiple=True)] = running.MODELS,
    data: Path | None = None,
    seed: int | None = None,
    size: str | None = None,
    crew: Annotated[Crew, Parameter(name="*")] = ALONE,
) -> None:
    """Repeat the paper's experiments: its tables II to IV, of every model, on recordings that know the truth.

    The recordings are simulated into out/recordings: the test part of a replica of EV-IMO by background, and a wall
    alone for the comparison with the classical method. The same command again makes and scores only what is missing.

    Args:
        out: where benchmark.html, benchmark.md, benchmark.csv and benchmark.json go, and what they are made from.
        minutes: of replica to simulate, shared by four backgrounds; planar recordings add a quarter. 5 unless told.
        models: presets, paths of ONNX files, or `classical`, the training-free method; the first one is looked at
            where it is worst.
        data: folder with recordings that know the truth, to be scored instead of simulated ones.
        seed: of the first recording; the others follow.
        size: WxH in pixels, if not the camera's own 346x260.
        crew: who simulates and scores.
    """
    check_installed("a benchmark", "matplotlib", "jinja2", extra="benchmark")
    if data is not None and (minutes, seed, size) != (None, None, None):
        raise BadInput(f"{SIMULATES} are of simulated recordings, not of --data", fix="leave them or --data out")
    crew.check()
    rivals = rivals_of(models)
    make_folder(out)
    folder, settings = data, {"recordings": str(data)}
    if folder is None:
        plan = _plan(MINUTES if minutes is None else minutes, SEED if seed is None else seed, size)
        folder = running.make_recordings(plan, out, crew=crew, progress=progress)
        settings = running.settings_of(plan)
    result = running.benchmark(folder, out, rivals=rivals, settings=settings, crew=crew, progress=progress)
    _show(result)
    print(f"saved in {out}: {', '.join(running.FILES)}")


def _plan(minutes: float, seed: int, size: str | None) -> "BenchmarkPlan":
    """What to simulate; only this needs the simulator."""
    check_installed("simulating", *SIMULATING, extra="benchmark")
    from evimo.simulate.benchmark_set import BenchmarkPlan

    return BenchmarkPlan(minutes=minutes, seed=seed, size=pixels_of(size))


def _show(result: Result) -> None:
    """Print the tables."""
    wide = console(WIDTH)
    for table in result.tables:
        wide.print(_drawn(table))
    for verdict in verdicts(result.tables):
        wide.print(Text(verdict))


def _drawn(table: ResultTable) -> Table:
    drawn = Table(title=f"Table {table.layout.key}: {table.layout.title}", title_justify="left", box=SIMPLE)
    drawn.add_column("")
    for column in table.columns:
        drawn.add_column(Text(header(column, between="\n")), justify="right")
    for block in table.blocks:
        drawn.add_row(block.title, style="bold")
        for row in block.rows:
            cells = (cell(row, column) for column in table.columns)
            drawn.add_row(f"  {row.name}", *cells, style=None if row.kind == "model" else "dim")
        drawn.add_row("  samples kept", *(str(block.kept(column)) for column in table.columns), style="dim")
        drawn.add_section()
    return drawn
