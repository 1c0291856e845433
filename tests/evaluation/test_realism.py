"""Verdicts on made-up statistics; and whether what `evimo simulate` makes looks like a real DAVIS346."""

import json
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from itertools import count, islice
from pathlib import Path

import numpy as np
import pytest
from pytest import approx

from evimo.errors import BadInput
from evimo.evaluation.event_statistics import EventStatistics, event_statistics
from evimo.evaluation.realism import MEASURES, Measure, Realism
from evimo.evaluation.statistics_kernel import INTERVAL_BINS
from evimo.events.events import joined
from evimo.formats import open_events
from evimo.formats.event_file import EventFile
from evimo.scene.motion import Motion
from evimo.simulate.pixels import Pixels
from evimo.simulate.plan import RecordingPlan
from evimo.simulate.recording import SimulatedRecording, simulate_recording
from evimo.simulate.sensor import draw_sensor
from evimo.writing import save_text

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
    save_text(realism.as_json(), tmp_path / "new" / "realism.json")
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


# What `evimo simulate` makes by default, beside real clips, like with like. All are of normal light: set 6 is dark, and
# so are some recordings of the others. The cameras of the DAVIS346 clips stand still, before a ball, a person or
# vehicles; those of the DAVIS240C clips move fast through scenes full of edges. Rows that depend on the scene are not
# judged; the others may leave the range as far as `MEASURES` says.

RESTING = (
    "recordings/davis346_ball_person/dvSave-2021_01_15_15_43_05.aedat4",
    "recordings/davis346_road/davis346.aedat4",
)
MOVING = (
    "recordings/davis240_poster/poster_translation.npz",
    "recordings/eed_what_is_background/EED_what_is_background_events.es",
)
SEED, RECORDINGS = 5000, 50  # of 20, medians still swing by more than what is judged
JUDGED = {measure.name: measure for measure in MEASURES if measure.judged}
BUSY_HZ = (
    0.2  # events per pixel: the clips of cameras at rest have 0.37 and 3.35; below, movers rest or are out of view
)
FULL = 0.2  # share of pixels that fire in a slice: 0.47 in either clip of a moving camera
LONELY = {"isolated", "quiet"}  # of faint patterns that pass by, too: 0.3 to 2.7 Hz in the clips of moving cameras
TOO_FULL = {"quiet"}  # where so much fires hardly any place is quiet, and which ones are is chance


def at_rest(recording: SimulatedRecording) -> SimulatedRecording:
    """The same with its camera standing where it would be half-way."""
    pose = recording.scene.camera.at(np.array([recording.plan.seconds / 2]))
    return replace(recording, scene=replace(recording.scene, camera=Motion(pose.position[0], pose.rotation[0])))


def in_normal_light(sensor: str, sets: tuple[int, ...], *, seconds: float) -> Iterator[SimulatedRecording]:
    """Recordings of these sets in turn, without end."""
    for seed in count(SEED):
        number = sets[seed % len(sets)]
        recording = simulate_recording(RecordingPlan(seed=seed, set_number=number, seconds=seconds, sensor=sensor))
        if recording.settings.floor < 0.01:
            yield recording


@cache
def resting_statistics() -> list[EventStatistics]:
    """Of cameras at rest before something that moves."""
    drawn = in_normal_light("davis346", (1, 2, 3, 4, 5), seconds=0.25)
    made = (filmed(at_rest(each)) for each in drawn if each.scene.movers)
    return list(islice((each for each in made if (each.values["rate"] or 0) > BUSY_HZ), RECORDINGS))


@cache
def moving_statistics() -> list[EventStatistics]:
    """Of fast cameras in full scenes."""
    made = (filmed(each) for each in in_normal_light("davis240", (3,), seconds=0.1))
    return list(islice((each for each in made if (each.values["active"] or 0) > FULL), RECORDINGS // 2))


@cache
def swept_statistics() -> list[EventStatistics]:
    """Of whatever `evimo simulate --set all` makes: cameras move, and some scenes are dark."""
    made = (
        simulate_recording(RecordingPlan(seed=SEED + 4000 + k, set_number=k % 6 + 1, seconds=0.1))
        for k in range(RECORDINGS // 2)
    )
    return [filmed(each) for each in made]


def filmed(recording: SimulatedRecording) -> EventStatistics:
    events = joined([part.events for part in recording])
    return event_statistics(in_memory(events, recording.camera.size, stop_us=round(recording.plan.seconds * 1e6)))


def in_memory(events, sensor: tuple[int, int], *, stop_us: int) -> EventFile:
    return EventFile(
        path=Path("simulated"), format="", sensor=sensor, start_us=0, stop_us=stop_us, read=lambda _: iter([events])
    )


@cache
def real_statistics(*paths: Path, sensor: tuple[int, int] | None = None) -> list[EventStatistics]:
    return [event_statistics(open_events(path, sensor=sensor)) for path in paths]


@pytest.mark.slow
@pytest.mark.parametrize("measure", JUDGED.values(), ids=JUDGED)
def test_default_recordings_look_like_those_of_a_davis346(measure, shared_data):
    verdict = Realism(real_statistics(*map(shared_data, RESTING)), resting_statistics()).verdict(measure)
    assert verdict.inside, verdict


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(JUDGED.keys() - LONELY))
def test_moving_cameras_fire_as_a_davis346_at_rest_does(name, shared_data):
    """There is no clip of a moving DAVIS346: what does not depend on the scene must not depend on that either."""
    verdict = Realism(real_statistics(*map(shared_data, RESTING)), swept_statistics()).verdict(JUDGED[name])
    assert verdict.inside, verdict


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*distortion")
@pytest.mark.parametrize("name", sorted(LONELY))
def test_moving_cameras_see_as_many_isolated_events_as_real_ones_at_rest_to_moving(name, shared_data):
    poster, net = map(shared_data, MOVING)
    real = [*real_statistics(*map(shared_data, RESTING)), *real_statistics(poster, sensor=(180, 240))]
    verdict = Realism([*real, *real_statistics(net)], swept_statistics()).verdict(JUDGED[name])
    assert verdict.inside, verdict


@pytest.mark.slow
@pytest.mark.parametrize("name", ["per_active", "one", "isolated"])
def test_most_recordings_are_near_those_of_a_davis346(name, shared_data):
    """Not only the median: scenes differ more than two clips do, but one recording in three keeps the widened range."""
    verdict = Realism(real_statistics(*map(shared_data, RESTING)), resting_statistics()).verdict(JUDGED[name])
    assert verdict.recordings_inside >= 0.33, verdict


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*distortion")
@pytest.mark.parametrize("name", sorted(JUDGED.keys() - TOO_FULL))
def test_moving_cameras_see_what_a_moving_davis240_does(name, shared_data):
    poster, net = map(shared_data, MOVING)
    real = [*real_statistics(poster, sensor=(180, 240)), *real_statistics(net)]
    verdict = Realism(real, moving_statistics()).verdict(JUDGED[name])
    assert verdict.inside, verdict


@pytest.mark.slow
def test_noise_of_default_sensors_is_that_of_a_davis346(shared_data):
    """Isolated events of a camera at rest, as that of the real clips, before a scene at rest."""
    real = real_statistics(*map(shared_data, RESTING))
    seen = np.exp(np.random.default_rng(0).uniform(np.log(0.03), np.log(0.95), (65, 86))).astype(np.float32)
    made = [noise(seed, seen, seconds=2.0) for seed in range(15)]
    verdict = Realism(real, made).verdict(JUDGED["quiet"])
    assert verdict.inside, verdict


def noise(seed: int, seen: np.ndarray, *, seconds: float) -> EventStatistics:
    rng = np.random.default_rng(seed)
    pixels = Pixels(draw_sensor(rng), rng, first=seen, start_s=0.0)
    times = np.arange(0, seconds + 0.01, 0.05)
    events = joined([pixels.events(np.stack((seen, seen)), times[k : k + 2]) for k in range(len(times) - 1)])
    order = np.argsort(events.t, kind="stable")
    events = type(events)(*(getattr(events, name)[order] for name in "xytp"))
    return event_statistics(in_memory(events, seen.shape, stop_us=round(seconds * 1e6)))
