"""What is said of the expected order of models."""

from evimo.benchmark.orders import verdicts
from evimo.benchmark.tables import LAYOUTS, Block, ResultTable, Row
from evimo.evaluation.columns import BY_NAME
from evimo.evaluation.ratios import Score


def table(key: str, score: str, **values: float) -> ResultTable:
    layout = next(layout for layout in LAYOUTS if layout.key == key)
    rows = tuple(Row(name, "model", {score: Score(value, 1)}) for name, value in values.items())
    return ResultTable(layout, (BY_NAME[score],), (Block("wall", "plain wall", rows),))


def test_the_order_of_masks_is_told_as_it_is():
    kept, broken = table("II", "iou", base=0.7, small=0.6, classical=0.1), table("II", "iou", base=0.5, tiny=0.6)
    assert [*verdicts([kept])] == ["IoU, plain wall: base 0.700, small 0.600, classical 0.100: as expected"]
    assert [*verdicts([broken])] == ["IoU, plain wall: base 0.500, tiny 0.600: NOT in the expected order"]
    assert [*verdicts([table("II", "iou", base=0.7)])] == []


def test_lower_is_better_for_errors():
    depth = table("IV", "abs_rel", base=0.2, small=0.3, tiny=0.25, classical=0.1)
    assert [*verdicts([depth])] == [
        "AbsRel, plain wall: base 0.200, small 0.300, tiny 0.250: NOT in the expected order"
    ]
    motion = table("III", "camera_aee", base=0.1, tiny=0.2, classical=0.3)
    assert [*verdicts([motion])] == ["cam AEE, plain wall: base 0.100, tiny 0.200, classical 0.300: as expected"]


def test_ecn_is_expected_last_on_depth():
    last, first = table("IV", "abs_rel", base=0.3, ecn=0.4), table("IV", "abs_rel", base=0.2, ecn=0.1)
    assert [*verdicts([last])] == ["AbsRel, plain wall: ecn 0.400 is last, as expected"]
    assert [*verdicts([first])] == ["AbsRel, plain wall: ecn 0.100 is NOT last, as was expected"]
    assert [*verdicts([table("IV", "abs_rel", base=0.2, classical=0.1)])] == []
