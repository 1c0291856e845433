"""One simulated recording: slices of events, and the truth at their centres."""

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from evimo.events.events import Events
from evimo.events.slices import SLICE_US
from evimo.geometry.camera import Camera
from evimo.recordings.imu import Imu
from evimo.recordings.pose_track import PoseTrack
from evimo.recordings.truth import Truth
from evimo.scene.bodies import Scene
from evimo.scene.renderer import Renderer
from evimo.simulate.cameras import draw_camera
from evimo.simulate.film import check_device, film_on, steps
from evimo.simulate.imu import ImuSettings, measured
from evimo.simulate.labelled_events import LabelledEvents, ids_of
from evimo.simulate.plan import SLICE_S, RecordingPlan
from evimo.simulate.populations import bank_of, drawn_scene, population_facts
from evimo.simulate.poses import scene_poses
from evimo.simulate.sensor import SensorSettings, draw_sensor

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]

WARM_UP_S = 0.015  # its events are dropped: by then refractory periods and the low-pass have settled
RECORDINGS_PER_BANK = 64  # of textures: building one takes seconds
ATTEMPTS = 40
GLANCES = 5  # at a scene before it is filmed, at least
DARK = 0.08  # share of dark recordings outside the dark set
LEAST_VISIBLE = 0.003  # share of pixels that movers must cover at some time, where there are movers
LAST_US = 1 << 62
EVENT_STREAM, IMU_STREAM = 0xE7E, 0x1A6  # of random numbers: what is added to one leaves the other as it was
IMU = ImuSettings()


@dataclass(frozen=True, slots=True)
class SimulatedSlice:
    """Events with k·25 ms <= t < (k+1)·25 ms, and the truth at the middle.

    clutter:   (H, W), which static body drawn like the movers is seen, 0 is none.
    event_ids: (N,) id of what each event's pixel saw at the event's own time, 0 is static.
    """

    events: Events
    truth: Truth
    clutter: NDArray[np.uint8]
    event_ids: NDArray[np.uint8]

    def of(self, labelled: LabelledEvents) -> "SimulatedSlice":
        """The same truth with other events."""
        return replace(self, events=labelled.events, event_ids=labelled.ids)

    @property
    def labelled(self) -> LabelledEvents:
        """The events with their ids."""
        return LabelledEvents(self.events, self.event_ids)


@dataclass(frozen=True)
class SimulatedRecording:
    """A scene, a camera and a sensor, ready to be filmed; iterating yields its slices.

    plan: it is made from this alone. settings: of the sensor. attempts: scenes drawn until one could be filmed.
    """

    plan: RecordingPlan
    camera: Camera
    scene: Scene
    settings: SensorSettings
    attempts: int = 1

    @property
    def slices(self) -> int:
        """How many slices it has."""
        return self.plan.slices

    def __iter__(self) -> Iterator[SimulatedSlice]:
        """Film it: constant memory, whatever the length."""
        film = _Slices(self)
        waiting, held = film.run(-WARM_UP_S, 0.0).labelled, None
        for index in range(self.slices):
            newest = film.run(index * SLICE_S, (index + 1) * SLICE_S)
            waiting = waiting.merged(newest.labelled)  # jitter mixes neighbouring slices
            if held:
                start_us, stop_us = (index - 1) * SLICE_US, index * SLICE_US
                yield held.of(waiting.between(start_us, stop_us))
                waiting = waiting.between(stop_us, LAST_US)
            held = newest
        if held:
            stop_us = self.slices * SLICE_US
            yield held.of(waiting.between(stop_us - SLICE_US, stop_us))

    def poses(self, times_us: NDArray[np.int64]) -> PoseTrack:
        """Where the camera and the movers are at times (M,)."""
        return scene_poses(self.scene, times_us)

    def imu(self, settings: ImuSettings = IMU) -> Imu:
        """What a gyroscope and an accelerometer at the camera say from time zero to the end of the last slice."""
        rng = np.random.default_rng((self.plan.seed, self.plan.set_number, IMU_STREAM))
        return measured(self.scene.camera, self.slices * SLICE_S, settings, rng)

    def facts(self) -> dict[str, object]:
        """What made it, for the recording's JSON."""
        return {
            **self.plan.facts(),
            "sensor": asdict(self.settings),
            "imu": asdict(IMU),
            "movers": len(self.scene.movers),
            "clutter_bodies": sum(body.clutter for body in self.scene.bodies),
            "attempts": self.attempts,
            **population_facts(self.plan, self.scene),
        }


def simulate_recording(plan: RecordingPlan) -> SimulatedRecording:
    """Draw the recording of a plan; it is filmed when it is iterated over.

    Raises:
        BadInput: no such camera or device. NotFound, BadFile: as `OwnFolders.check` says.
    """
    check_device(plan.device)
    bank = bank_of(plan, plan.seed // RECORDINGS_PER_BANK)
    glances = max(GLANCES, math.ceil(plan.seconds)) if plan.part else GLANCES
    attempt = 0
    while True:
        rng = np.random.default_rng((plan.seed, plan.set_number, attempt))
        lens = draw_camera(rng, plan.camera, plan.pixels)
        scene = drawn_scene(plan, rng, bank)
        attempt += 1
        if _is_watchable(scene, lens, plan.seconds, glances) or attempt == ATTEMPTS:
            settings = draw_sensor(rng, dark=plan.style.dark or rng.random() < DARK, sensor=plan.sensor)
            return SimulatedRecording(plan, lens, scene, settings, attempt)


def _is_watchable(scene: Scene, camera: Camera, seconds: float, glances: int) -> bool:
    """Some mover is seen at some time, nothing covers the camera, and the camera stays in the room."""
    renderer = Renderer(scene, camera)
    times = np.linspace(0.5 * SLICE_S, seconds - 0.5 * SLICE_S, glances)
    depth, parts = renderer.glance(times)
    if np.median(depth, axis=1).min() < 0.3 or (parts < 0).any():
        return False
    movers = (renderer.packed.ids[parts] > 0).mean(axis=1)
    return movers.max() < 0.5 and (not scene.movers or movers.max() > LEAST_VISIBLE)


class _Slices:
    """Films a scene slice by slice."""

    def __init__(self, recording: SimulatedRecording) -> None:
        renderer, settings, plan = Renderer(recording.scene, recording.camera), recording.settings, recording.plan
        rng = np.random.default_rng((plan.seed, plan.set_number, EVENT_STREAM))
        self.renderer, self.tick_us = renderer, settings.tick_us
        self.film = film_on(plan.device)(renderer, settings, rng, start_s=-WARM_UP_S)

    def run(self, start_s: float, stop_s: float) -> SimulatedSlice:
        """Events of [start_s, stop_s) up to jitter, and the truth in the middle."""
        time_s, strides = steps(self.renderer, start_s, stop_s)
        events, frames, strides = self.film.run(time_s, strides)
        ids = ids_of(events, self.renderer, frames, time_s=time_s, strides=strides)
        seen = frames.seen(len(time_s) // 2)
        clutter = np.where(seen[1] >= 0, self.renderer.packed.clutter[np.maximum(seen[1], 0)], 0)
        truth = self.renderer.truth(round(0.5 * (start_s + stop_s) * 1e6), seen)
        return SimulatedSlice(_on_clock(events, self.tick_us), truth, clutter.astype(np.uint8), ids)


def _on_clock(events: Events, tick_us: int) -> Events:
    return events if tick_us == 1 else replace(events, t=events.t // tick_us * tick_us)
