"""What is expected of the models' order, and whether the tables show it."""

from collections.abc import Iterator, Sequence
from itertools import pairwise

from evimo.benchmark.tables import Block, ResultTable, printed
from evimo.evaluation.columns import BY_NAME

NETWORKS = ("base", "small", "tiny")
BY_QUALITY = (*NETWORKS, "classical")
"""Best first, as their cost lets one expect."""
LAST_ON_DEPTH = "ecn"


def verdicts(tables: Sequence[ResultTable]) -> Iterator[str]:
    """One sentence for each expected order: of masks and depth by scene, and of egomotion."""
    for table in tables:
        for block in table.blocks:
            if table.layout.key == "II":
                yield from _ordered(block, "iou", BY_QUALITY)
            if table.layout.key == "III":
                yield from _ordered(block, "camera_aee", BY_QUALITY)
            if table.layout.key == "IV":
                yield from _ordered(block, "abs_rel", NETWORKS)
                yield from _last(block, "abs_rel", NETWORKS)


def _ordered(block: Block, name: str, expected: Sequence[str]) -> Iterator[str]:
    column = BY_NAME[name]
    values = {row.name: printed(row, column) for row in block.rows if row.kind == "model"}
    found = [(model, value) for model in expected if (value := values.get(model)) is not None]
    if len(found) < 2:
        return
    sign = 1 if column.better == "higher" else -1
    kept = all(sign * a >= sign * b for (_, a), (_, b) in pairwise(found))
    text = ", ".join(f"{model} {value:.{column.digits}f}" for model, value in found)
    yield f"{column.header}, {block.title}: {text}: {'as expected' if kept else 'NOT in the expected order'}"


def _last(block: Block, name: str, others: Sequence[str]) -> Iterator[str]:
    column = BY_NAME[name]
    values = {row.name: value for row in block.rows if (value := printed(row, column)) is not None}
    rivals = [values[other] for other in others if other in values]
    if LAST_ON_DEPTH in values and rivals:
        last = values[LAST_ON_DEPTH] >= max(rivals)
        words = "last, as expected" if last else "NOT last, as was expected"
        yield f"{column.header}, {block.title}: {LAST_ON_DEPTH} {values[LAST_ON_DEPTH]:.{column.digits}f} is {words}"
