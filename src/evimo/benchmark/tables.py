"""The paper's tables II to IV of our own numbers: which scenes, which columns, which rows."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from evimo.benchmark.paper import CLASSIC, DEPTH, MOTION, PaperTable
from evimo.benchmark.scenes import ALL, ELSE, OTHER, PLANAR, SCENES
from evimo.benchmark.tally import Tally
from evimo.evaluation import baselines, ceilings
from evimo.evaluation.column import Column
from evimo.evaluation.columns import BY_NAME
from evimo.evaluation.ratios import Scores
from evimo.evaluation.report import MODEL

Kept = Mapping[str, Mapping[str, Tally]]
"""Tallies by the model's name, `scoring.TRIVIAL` among them, and by scene."""


@dataclass(frozen=True, slots=True)
class Layout:
    """How one table is made.

    key: of files and anchors. scenes: those of the paper, in its order. columns: names of scores.
    trivial: rows of answers and ceilings that stand beside the models. paper: what the paper says.
    others: whether recordings of no scene of the paper's have a block, too.
    """

    key: str
    title: str
    about: str
    scenes: tuple[str, ...]
    columns: tuple[str, ...]
    trivial: tuple[str, ...]
    paper: PaperTable
    others: bool = True


LAYOUTS = (
    Layout(
        "II",
        "Segmentation and motion",
        "Camera velocity at the true speed and at the scale of the depths, camera rotation, object velocity, how many"
        " objects have one, and motion masks.",
        ("table", "wall", "fast"),
        ("camera_aee", "camera_aee_depth", "camera_rre", "object_aee", "objects_found", "iou"),
        (baselines.ZERO_TWIST, baselines.EVERYTHING, baselines.DENSITY, ceilings.DEPTH_UNKNOWN, ceilings.TRUE_FLOW),
        MOTION,
    ),
    Layout(
        "III",
        "Against four-parameter motion compensation",
        "Recordings that suit the classical method: one plane, no objects, no roll or pitch.",
        (PLANAR,),
        ("camera_aee", "camera_aee_depth", "camera_rre", "direction"),
        (baselines.ZERO_TWIST,),
        CLASSIC,
        others=False,
    ),
    Layout(
        "IV",
        "Depth",
        "Dense depth over all scored pixels, at the scale of the truth by the medians of each frame. The classical"
        " method knows no depth: its numbers are those of one depth everywhere.",
        ("wall", "box", "table"),
        ("abs_rel", "rmse_log", "silog", "delta_1", "delta_2", "delta_3"),
        (baselines.CONSTANT_DEPTH,),
        DEPTH,
    ),
)


@dataclass(frozen=True, slots=True)
class Row:
    """One line. kind: `model`, `trivial` answer or `ceiling`."""

    name: str
    kind: str
    scores: Scores


@dataclass(frozen=True, slots=True)
class Block:
    """The rows of one scene."""

    scene: str
    title: str
    rows: tuple[Row, ...]

    def best(self, column: Column) -> set[str]:
        """The models with the best printed value of that column, if that beats what every trivial answer has."""
        sign = 1 if column.better == "higher" else -1
        values = {row.name: sign * value for row in self.rows if (value := printed(row, column)) is not None}
        kinds = {row.name: row.kind for row in self.rows}
        models = [value for name, value in values.items() if kinds[name] == "model"]
        trivial = [value for name, value in values.items() if kinds[name] == "trivial"]
        if len(models) < 2 or max(models) <= max(trivial, default=max(models) - 1):
            return set()
        return {name for name, value in values.items() if kinds[name] == "model" and value == max(models)}

    def kept(self, column: Column) -> int:
        """How many slices, or objects in slices, are in the first number of that column."""
        return next((row.scores[column.name].samples for row in self.rows if column.name in row.scores), 0)


@dataclass(frozen=True, slots=True)
class ResultTable:
    """One table of our own numbers. left_out: titles of scenes that there are, and that the paper's table has not."""

    layout: Layout
    columns: tuple[Column, ...]
    blocks: tuple[Block, ...]
    left_out: tuple[str, ...] = ()

    @property
    def about(self) -> str:
        """What the table shows, and what it does not."""
        without = f" As in the paper, without recordings of: {', '.join(self.left_out)}." if self.left_out else ""
        return self.layout.about + without


def value_of(row: Row, column: Column) -> float | None:
    """One number; None where nothing was scored."""
    score = row.scores.get(column.name)
    return score.value if score else None


def printed(row: Row, column: Column) -> float | None:
    """The same to as many digits as are printed: what looks equal is equal."""
    value = value_of(row, column)
    return None if value is None else round(value, column.digits)


def tables_of(kept: Kept, *, models: Sequence[str], trivial: str) -> list[ResultTable]:
    """The paper's tables, of the scenes that there are; other recordings are together in a block of their own."""
    here = {scene for tallies in kept.values() for scene in tallies}
    tables: list[ResultTable] = []
    for layout in LAYOUTS:
        blocks: list[Block] = []
        scenes = _scenes(layout, here)
        for scene, members in scenes.items():
            tallies = {name: total(each[k] for k in members if k in each) for name, each in kept.items()}
            title = SCENES[scene].title if scene in SCENES else scene
            blocks.append(Block(scene, title, tuple(_rows(layout, tallies, models, trivial))))
        columns = tuple(BY_NAME[name] for name in layout.columns)
        shown = {PLANAR, *(scene for members in scenes.values() for scene in members)}
        left_out = tuple(SCENES[scene].title for scene in SCENES if layout.others and scene in here - shown)
        tables.append(ResultTable(layout, columns, tuple(block for block in blocks if block.rows), left_out))
    return [table for table in tables if table.blocks]


def _scenes(layout: Layout, here: set[str]) -> dict[str, list[str]]:
    """The blocks of a table by name, each with the scenes in it.

    What is not the paper's has a block where nothing else would tell of it: of backgrounds that nobody knows, or where
    there is no other block.
    """
    blocks = {scene: [scene] for scene in layout.scenes if scene in here}
    left = sorted(here - {*layout.scenes, PLANAR})
    if layout.others and left and (OTHER in left or not blocks):
        blocks[ELSE if blocks else ALL] = left
    return blocks


def _rows(layout: Layout, tallies: Mapping[str, Tally], models: Sequence[str], trivial: str) -> Iterator[Row]:
    for model in models:
        rows = tallies[model].rows
        if any(name in rows.get(MODEL, {}) for name in layout.columns):
            yield Row(model, "model", rows[MODEL])
    rows = tallies[trivial].rows
    for name in layout.trivial:
        if any(column in rows.get(name, {}) for column in layout.columns):
            yield Row(name, "ceiling" if name in ceilings.ROWS else "trivial", rows[name])


def total(tallies: Iterable[Tally]) -> Tally:
    """Tallies as one."""
    return sum(tallies, Tally())
