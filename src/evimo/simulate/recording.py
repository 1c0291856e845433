"""One simulated recording: slices of events, and the truth at their centres."""

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadInput
from evimo.events.events import Events
from evimo.events.slices import SLICE_US
from evimo.geometry.camera import Camera
from evimo.recordings.imu import Imu
from evimo.recordings.pose_track import PoseTrack
from evimo.recordings.truth import Truth
from evimo.scene.bodies import Scene
from evimo.scene.drawing.pools import POOLS
from evimo.scene.drawing.scenes import SETS, SetStyle
from evimo.scene.renderer import Renderer
from evimo.simulate.cameras import draw_camera
from evimo.simulate.film import check_device, film_on, steps
from evimo.simulate.imu import ImuSettings, measured
from evimo.simulate.labelled_events import LabelledEvents, ids_of
from evimo.simulate.own_folders import OWN, OwnFolders
from evimo.simulate.populations import bank_of, check_population, drawn_scene, population_facts
from evimo.simulate.poses import scene_poses
from evimo.simulate.sensor import SensorSettings, draw_sensor, known_sensor

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]

SLICE_S = SLICE_US * 1e-6
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

    seed, set_number: it is made from these alone (and seconds, camera and sensor). settings: of the sensor.
    sensor: its kind. part, room: what its scene was held to, if it was. own: the user's folders it was drawn from.
    device: that films it, `cpu` or `cuda`. population: of scenes, one of `populations.POPULATIONS`.
    """

    seed: int
    set_number: int
    seconds: float
    camera: Camera
    scene: Scene
    settings: SensorSettings
    attempts: int
    sensor: str = "davis346"
    part: str | None = None
    room: str | None = None
    own: OwnFolders = OWN
    device: str = "cpu"
    population: str = "stress"

    @property
    def slices(self) -> int:
        """How many slices it has."""
        return round(self.seconds / SLICE_S)

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
        rng = np.random.default_rng((self.seed, self.set_number, IMU_STREAM))
        return measured(self.scene.camera, self.slices * SLICE_S, settings, rng)

    def facts(self) -> dict[str, object]:
        """What made it, for the recording's JSON."""
        held = {"part": self.part, "room": self.room} if self.part or self.room else {}
        return {
            "set": self.set_number,
            "seed": self.seed,
            "seconds": self.seconds,
            "sensor_kind": self.sensor,
            "sensor": asdict(self.settings),
            "imu": asdict(IMU),
            "movers": len(self.scene.movers),
            "clutter_bodies": sum(body.clutter for body in self.scene.bodies),
            "attempts": self.attempts,
            "device": self.device,
            **held,
            **population_facts(self.population, self.scene, SETS[self.set_number], self.part),
            **self.own.facts(),
        }


def simulate_recording(
    seed: int,
    *,
    set_number: int = 1,
    seconds: float = 1.0,
    camera: str = "random",
    sensor: str = "davis346",
    size: tuple[int, int] | None = None,
    part: str | None = None,
    room: str | None = None,
    own: OwnFolders = OWN,
    device: str = "cpu",
    population: str = "stress",
) -> SimulatedRecording:
    """Draw a recording of one of the paper's sets.

    Args:
        seed: the same seed gives the same recording. set_number: 1 to 6.
        seconds: a multiple of 0.025. camera: `random` or `evimo`. sensor: one of `sensor.SENSORS`.
        size: height and width in px, if not the sensor's own.
        part: `train` or `test` draws textures and shapes that the other, and a recording without, never have.
        room: one of the set's. own: folders of pictures for textures, and of meshes.
        device: that films it, `cpu` or `cuda`: the same scene, but not quite the same events, as a GPU casts every
            tile in every frame.
        population: `stress`, or `replica`: as EV-IMO's pictures show it, where 8 % of short scenes lack movers, unless
            they are held to a room or for testing.

    Raises:
        BadInput: no such set, camera, sensor, part, room, device or population, or less than one slice.
        NotFound, BadFile: as `OwnFolders.check` says.
    """
    if set_number not in SETS:
        raise BadInput(f"no set {set_number}", fix="a set from 1 to 6")
    if round(seconds / SLICE_S) < 1:
        raise BadInput(f"a recording of {seconds} s", fix="at least 0.025 s")
    check_device(device)
    check_population(population)
    kind = known_sensor(sensor)
    style, bank = _style(set_number, part, room), bank_of(population, seed // RECORDINGS_PER_BANK, part, own)
    glances = max(GLANCES, math.ceil(seconds)) if part else GLANCES
    attempt = 0
    while True:
        rng = np.random.default_rng((seed, set_number, attempt))
        lens = draw_camera(rng, camera, size or kind.size)
        scene = drawn_scene(population, rng, style, bank, seconds=seconds, part=part, whole=room is not None, own=own)
        attempt += 1
        if _is_watchable(scene, lens, seconds, glances) or attempt == ATTEMPTS:
            settings = draw_sensor(rng, dark=style.dark or rng.random() < DARK, sensor=sensor)
            drawn = SimulatedRecording(seed, set_number, seconds, lens, scene, settings, attempt)
            held_to = replace(drawn, part=part, room=room, own=own, population=population)
            return replace(held_to, sensor=sensor, device=device)


def _style(set_number: int, part: str | None, room: str | None) -> SetStyle:
    """The style of a set, in one of its rooms if that is asked for."""
    style = SETS[set_number]
    if part is not None and part not in POOLS:
        raise BadInput(f"no part {part!r}", fix=f"one of {', '.join(POOLS)}")
    if room is not None and room not in style.rooms:
        raise BadInput(f"no room {room!r} in set {set_number}", fix=f"one of {', '.join(style.rooms)}")
    return style if room is None else replace(style, rooms=(room,))


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
        renderer, settings = Renderer(recording.scene, recording.camera), recording.settings
        rng = np.random.default_rng((recording.seed, recording.set_number, EVENT_STREAM))
        self.renderer, self.tick_us = renderer, settings.tick_us
        self.film = film_on(recording.device)(renderer, settings, rng, start_s=-WARM_UP_S)

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
