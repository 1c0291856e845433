"""Verdicts on made-up statistics; and whether what `evimo simulate` makes looks like a real DAVIS346."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from pytest import approx

from evimo.errors import BadInput
from evimo.evaluation.event_statistics import EventStatistics, event_statistics
from evimo.evaluation.realism import MEASURES, Measure, Realism
from evimo.evaluation.statistics_kernel import INTERVAL_BINS
from evimo.events.events import joined
from evimo.events.io import open_events
from evimo.events.io.event_file import EventFile
from evimo.simulate.pixels import Pixels
from evimo.simulate.recording import simulate_recording
from evimo.simulate.sensor import draw_sensor

FACTOR = Measure(name="isolated", header="isolated", meaning="", factor=2.0)
MARGIN = Measure(name="on", header="ON", meaning="", margin=0.05)
SHOWN = Measure(name="rate", header="rate", meaning="")


def statistics(**values: float | None) -> EventStatistics:
    return EventStatistics(
        name="made up",
        sensor=(4, 5),
        slices=2,
        events=7,
        hot_pixels=0,
        values={measure.name: None for measure in MEASURES} | values,
        intervals=np.zeros(INTERVAL_BINS, np.int64),
        counts=np.array([33, 7]),
        per_slice=np.array([3, 4]),
    )


def compared(real: list[float | None], simulated: list[float | None], measure: Measure) -> Realism:
    return Realism(*([statistics(**{measure.name: value}) for value in values] for values in (real, simulated)))


def test_the_median_is_judged_against_the_widened_range():
    verdict = compared([0.1, 0.4], [0.06, 0.7, 0.9], FACTOR).verdict(FACTOR)
    assert (verdict.low, verdict.high, verdict.median) == (0.1, 0.4, 0.7)
    assert verdict.inside  # below 0.8
    assert verdict.off == approx(0.7 / 0.4)
    assert verdict.recordings_inside == approx(2 / 3)


@pytest.mark.parametrize(("simulated", "inside", "off"), [(0.36, True, -0.04), (0.34, False, -0.06), (0.5, True, 0)])
def test_a_margin_is_added_to_both_ends(simulated, inside, off):
    verdict = compared([0.4, 0.52], [simulated], MARGIN).verdict(MARGIN)
    assert verdict.inside is inside
    assert verdict.off == approx(off)


def test_what_depends_on_the_scene_is_shown_and_not_judged():
    verdict = compared([1.0], [50.0], SHOWN).verdict(SHOWN)
    assert (verdict.low, verdict.median, verdict.inside, verdict.recordings_inside) == (1, 50, None, None)


def test_recordings_without_a_value_do_not_count():
    verdict = compared([0.1, None], [None, 0.1], FACTOR).verdict(FACTOR)
    assert (verdict.real, verdict.inside, verdict.recordings_inside) == ((0.1, None), True, 1)
    nothing = compared([None], [0.1], FACTOR)
    assert nothing.verdict(FACTOR).inside is None
    assert nothing.outside == ()


def test_a_report_saves_all_of_it_as_json(tmp_path):
    realism = compared([0.1], [0.9], FACTOR)
    realism.save(tmp_path / "new" / "realism.json")
    saved = json.loads((tmp_path / "new" / "realism.json").read_text())
    assert saved["outside"] == ["isolated"]
    assert saved["verdicts"]["isolated"]["off"] == approx(9)
    assert saved["simulated"][0]["values"]["isolated"] == 0.9
    assert saved["real"][0]["pixels_in_slices_by_count"] == [33, 7]
    assert len(saved["real"][0]["interval_ms"]) == len(saved["real"][0]["share_of_intervals_up_to"])


@pytest.mark.parametrize(("real", "simulated", "kind"), [([], [1.0], "real"), ([1.0], [], "simulated")])
def test_nothing_to_compare_is_one_error(real, simulated, kind):
    with pytest.raises(BadInput, match=f"no {kind} recording"):
        compared(real, simulated, SHOWN)


# What `evimo simulate` makes by default, beside the real DAVIS346 clips. These are of normal light: set 6 is dark.

REAL_CLIPS = (
    "recordings/davis346_ball_person/dvSave-2021_01_15_15_43_05.aedat4",
    "recordings/davis346_road/davis346.aedat4",
)
SEEDS, SETS, SECONDS = range(5000, 5010), (1, 2, 3, 4, 5), 0.1
JUDGED = [measure for measure in MEASURES if measure.judged]
TOO_FEW = "edges fire too few events: 1.26 per active pixel instead of 1.70, 79 % with one instead of 56-62 %"
TOO_LONELY = (
    "0.64 Hz of isolated events instead of 0.01-0.14; 0.59 without any noise, so from weak texture that moves: "
    "the cameras of the real clips stand still, ours do not, and no real DAVIS346 clip of a moving camera is at hand"
)
GIVES_AWAY = {"per_active": TOO_FEW, "one": TOO_FEW, "isolated": TOO_LONELY, "quiet": TOO_LONELY}


def expected(measure: Measure):
    """The measure, marked if the simulation does not yet pass."""
    reason = GIVES_AWAY.get(measure.name)
    marks = [pytest.mark.xfail(strict=True, reason=reason, raises=AssertionError)] if reason else []
    return pytest.param(measure, id=measure.name, marks=marks)


@cache
def simulated_statistics() -> list[EventStatistics]:
    made: list[EventStatistics] = []
    for seed in SEEDS:
        number = SETS[seed % len(SETS)]
        recording = simulate_recording(seed, set_number=number, seconds=SECONDS)
        events = joined([part.events for part in recording])
        made.append(event_statistics(in_memory(events, recording.camera.size, stop_us=round(SECONDS * 1e6))))
    return made


def in_memory(events, sensor: tuple[int, int], *, stop_us: int) -> EventFile:
    return EventFile(
        path=Path("simulated"), format="", sensor=sensor, start_us=0, stop_us=stop_us, read=lambda _: iter([events])
    )


@cache
def real_statistics(*paths: Path) -> list[EventStatistics]:
    return [event_statistics(open_events(path)) for path in paths]


@pytest.mark.slow
@pytest.mark.parametrize("measure", [expected(measure) for measure in JUDGED])
def test_default_recordings_look_like_those_of_a_davis346(measure, shared_data):
    real = real_statistics(*map(shared_data, REAL_CLIPS))
    verdict = Realism(real, simulated_statistics()).verdict(measure)
    assert verdict.inside, verdict


@pytest.mark.slow
def test_noise_of_default_sensors_is_that_of_a_davis346(shared_data):
    """Isolated events of a camera at rest, as that of the real clips, before a scene at rest."""
    real = real_statistics(*map(shared_data, REAL_CLIPS))
    seen = np.exp(np.random.default_rng(0).uniform(np.log(0.03), np.log(0.95), (65, 86))).astype(np.float32)
    made = [noise(seed, seen, seconds=2.0) for seed in range(15)]
    verdict = Realism(real, made).verdict(next(measure for measure in JUDGED if measure.name == "quiet"))
    assert verdict.inside, verdict


def noise(seed: int, seen: np.ndarray, *, seconds: float) -> EventStatistics:
    rng = np.random.default_rng(seed)
    pixels = Pixels(draw_sensor(rng), rng, first=seen, start_s=0.0)
    times = np.arange(0, seconds + 0.01, 0.05)
    events = joined([pixels.events(np.stack((seen, seen)), times[k : k + 2]) for k in range(len(times) - 1)])
    order = np.argsort(events.t, kind="stable")
    events = type(events)(*(getattr(events, name)[order] for name in "xytp"))
    return event_statistics(in_memory(events, seen.shape, stop_us=round(seconds * 1e6)))
