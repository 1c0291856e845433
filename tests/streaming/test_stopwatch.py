import pytest

from evimo.streaming.stopwatch import Stopwatch


class Clock:
    now_s = 0.0

    def __call__(self) -> float:
        return self.now_s

    def sleep(self, seconds: float) -> None:
        self.now_s += seconds


def test_an_inner_stage_is_taken_off_the_outer_one():
    clock = Clock()
    watch = Stopwatch(clock)
    with watch.stage("outer"):
        clock.sleep(2)
        with watch.stage("inner"):
            clock.sleep(5)
        with watch.stage("inner"), watch.stage("innermost"):
            clock.sleep(7)
        clock.sleep(1)
    assert watch.seconds == {"outer": 3, "inner": 5, "innermost": 7}


def test_over_counts_the_making_and_not_the_use():
    clock = Clock()
    watch = Stopwatch(clock)

    def slow():
        for number in range(3):
            clock.sleep(1)
            yield number

    seen = []
    for number in watch.over("making", slow()):
        clock.sleep(10)
        seen.append(number)
    assert seen == [0, 1, 2]
    assert watch.seconds == {"making": 3}


def test_mean_is_per_item_in_ms():
    watch = Stopwatch()
    watch.seconds["made up"] = 0.5
    assert watch.mean_ms(10) == {"made up": pytest.approx(50)}
    assert watch.mean_ms(0) == {"made up": pytest.approx(500)}
