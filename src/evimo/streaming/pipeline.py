"""The main job: packets in, estimates out, in constant memory.

One thread reads events, cuts slices and places them in the rectified image. Several run the first pass, a slice each,
from which small graphs gain more than from threads inside one slice. As many correct what it found by direct alignment,
take the camera's motion out of the events and run the second pass. Instead of both passes there may be the fit of
`four_parameters`. The caller's own thread lets neighbouring slices agree and finds objects. Bounded queues join them,
so an hour needs no more memory than a second.
"""

from collections.abc import Generator, Iterator
from contextlib import closing
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from evimo.arguments import size_of
from evimo.errors import BadInput
from evimo.events.events import Events, joined
from evimo.events.slices import Slice, in_slices, in_stacks
from evimo.events.stack import EventStack
from evimo.formats.event_file import EventFile
from evimo.formats.in_memory import recording_of
from evimo.formats.opening import open_events
from evimo.formats.sensors import size_in_words
from evimo.geometry.calibration import load_camera
from evimo.geometry.camera import Camera, assumed_camera
from evimo.geometry.rectification import rectified
from evimo.recordings.estimate import Estimate
from evimo.streaming.agreement import Agreement
from evimo.streaming.event_labels import EventLabeller
from evimo.streaming.inference import Answer
from evimo.streaming.looks import Placed, stacked
from evimo.streaming.models import Model, model_of, passes_of
from evimo.streaming.objects import ObjectFinder
from evimo.streaming.passes import Stacked
from evimo.streaming.rotation import NO_ROTATION, Rotation
from evimo.streaming.span import AGREEING, STACKED, span_of
from evimo.streaming.stopwatch import Stopwatch
from evimo.streaming.threads import ahead, in_parallel

CAMERA = "evimo.Camera(fx=…, fy=…, cx=…, cy=…, height=…, width=…), or the path of a calibration file"
AHEAD = 2  # stacks that wait for the networks


def run(
    events: EventFile | Events | str | Path | NDArray[Any],
    *,
    model: str | Path = "small",
    camera: Camera | str | Path | None = None,
    sensor: tuple[int, int] | None = None,
    start_s: float = 0.0,
    stop_s: float | None = None,
    event_labels: bool = False,
    imu: str = "auto",
) -> Iterator[Estimate]:
    """Estimate depth, moving objects and motion for each complete slice of 25 ms.

    Args:
        events: a recording, from `open_events`; or its path; or events in memory: `Events`, a structured array with
            fields t, x, y and p, or an array (N, 4) whose columns are t, x, y and p; t in whole µs.
        model: a preset's name, or the path of an ONNX file, or `classical`, the training-free method; `ecn`
            finds no moving objects.
        camera: of the sensor, or the path of a calibration file; without it what the recording says of itself, else a
            guess (with a warning).
        sensor: (height, width) in px, where the recording does not tell; of events in memory the camera's is known.
        start_s: seconds after the first event. Start and stop select slices, they never move them: slice k is
            [k·25 ms, (k + 1)·25 ms) of the recording's own clock, and its estimate is the same in any span (the ids
            of objects count from the first slice of the span, and the axes of a gyroscope that does not know its
            camera's are found in the first four seconds of it).
        stop_s: seconds after the first event; None is the end.
        event_labels: give each estimate `event_labels`, and objects whose flow and velocity their events sharpened.
        imu: `auto` takes the camera's rotation from the recording's gyroscope where there is one; `off` does not.

    Raises:
        NotFound, BadFile: the model, or the recording or calibration at that path.
        BadInput: `events` are none, or not on the camera; the camera is none, or of another size; the span holds no
            complete slice; `imu` is neither; `event_labels` of a model that finds no objects.
    """
    recording = _recording(events, sensor, camera)
    return estimates_of(
        Run(
            recording,
            model_of(model),
            camera=_loaded(camera, recording),
            start_s=start_s,
            stop_s=stop_s,
            event_labels=event_labels,
            imu=imu,
        )
    )


def _recording(
    events: EventFile | Events | str | Path | NDArray[Any], sensor: tuple[int, int] | None, camera: object
) -> EventFile:
    if isinstance(events, EventFile):
        if sensor is not None and size_of(sensor, "sensor") != events.sensor:
            raise BadInput(
                f"{events.path.name} was opened with a sensor of {size_in_words(events.sensor)}",
                fix="open_events(PATH, sensor=…), and none here",
            )
        return events
    if isinstance(events, str | PathLike):
        return open_events(events, sensor=sensor)
    return recording_of(events, sensor=camera.size if sensor is None and isinstance(camera, Camera) else sensor)


def _loaded(camera: object, recording: EventFile) -> Camera | None:
    """The camera, or that of a calibration file."""
    if camera is None or isinstance(camera, Camera):
        return camera
    if not isinstance(camera, str | PathLike):
        raise BadInput(f"a camera is given as a value of type {type(camera).__name__}", fix=CAMERA)
    return load_camera(Path(camera), size=recording.sensor, topic=recording.topic)


def estimates_of(prepared: "Run") -> Iterator[Estimate]:
    """Do a run, and give its estimates one by one."""
    with closing(prepared.slices()) as slices:
        for estimate, _ in slices:
            yield estimate


class Run:
    """One run over a recording, prepared and checked; `slices` does it.

    span:          the slices it covers.
    rectification: between sensor pixels and the networks' image.
    camera_source: where the camera comes from: given, the recording, or assumed.
    placed:        brings events into that image; counts those that have no place there.
    finder:        of objects; counts them.
    stopwatch:     where the time went.
    """

    def __init__(
        self,
        events: EventFile,
        network: Model,
        *,
        camera: Camera | None = None,
        start_s: float = 0.0,
        stop_s: float | None = None,
        event_labels: bool = False,
        imu: str = "auto",
    ) -> None:
        """See `run`."""
        if imu not in ("auto", "off"):
            raise BadInput(f"no way {imu!r} to use an IMU", fix="auto or off")
        if event_labels and not network.finds_objects:
            raise BadInput(
                f"{network.name} finds no objects that events could belong to",
                fix="no --event-labels, or --model small",
            )
        self.events = events
        self.network = network
        self.span = span_of(events, start_s=start_s, stop_s=stop_s)
        camera, self.camera_source = _camera_of(events, camera)
        self.rectification = rectified(camera)
        self.rectification.warn_of_invalid()
        self.placed = Placed(self.rectification)
        self.stopwatch = Stopwatch()
        self._passes = passes_of(network, self.rectification, self.stopwatch)
        self._agreement = Agreement(self.rectification)
        self.finder = ObjectFinder(self.rectification, wanted=network.finds_objects)
        self._labeller = EventLabeller(self.rectification) if event_labels else None
        self._rotation = NO_ROTATION if imu == "off" else None

    @property
    def labels_events(self) -> bool:
        """Whether estimates come with `event_labels`."""
        return self._labeller is not None

    @property
    def rotation(self) -> Rotation:
        """What is known of the camera's rotation; a gyroscope's axes are found when it is first asked for."""
        if self._rotation is None:
            self._rotation = self._passes.rotation(self.events, self._stacks)
            self.placed.dropped = 0
        return self._rotation

    def slices(self) -> Generator[tuple[Estimate, Events]]:
        """Each slice's estimate and its events; once."""
        found = self._found()
        if self._labeller is not None:
            found = in_parallel(partial(self._labelled, self._labeller), found, workers=self.network.workers)
        with closing(found):
            for estimate, stacked in found:
                yield estimate, stacked.part.events

    def _found(self) -> Generator[tuple[Estimate, Stacked]]:
        """Each slice's estimate, without labels of events."""
        rotation = self.rotation
        stacks = ahead(self._stacks(), depth=AHEAD)
        with closing(self._passes.answers(stacks, self.span, rotation)) as answers:
            for row in in_stacks(answers, None, length=AGREEING):
                middle = row[AGREEING // 2]
                if middle is None or not self.span.first <= middle[0].part.index < self.span.last:
                    continue
                yield self._estimate(middle[0].part, [each and each[1] for each in row]), middle[0]

    def _estimate(self, part: Slice, row: list[Answer | None]) -> Estimate:
        """The estimate of a slice from the answers around it; None is of a slice without events, or beyond the ends."""
        if row[AGREEING // 2] is None:
            return self.finder.nothing(start_us=part.start_us, stop_us=part.stop_us)
        with self.stopwatch.stage("agreement"):
            answer = self._agreement.of(row)
        with self.stopwatch.stage("objects"):
            return self.finder.estimate(answer, start_us=part.start_us, stop_us=part.stop_us)

    def _labelled(self, labeller: EventLabeller, found: tuple[Estimate, Stacked]) -> tuple[Estimate, Stacked]:
        estimate, stacked = found
        with self.stopwatch.stage("event labels"):
            return labeller.label(estimate, stacked.window), stacked

    def _slices(self) -> Iterator[Slice]:
        span = self.span
        packets = self.stopwatch.over("reading", self.events.packets(span.read_start_us, span.read_stop_us))
        slices = in_slices(packets, start_us=span.read_start_us, stop_us=span.read_stop_us)
        yield from self.stopwatch.over("slicing", slices)

    def _placed(self) -> Iterator[tuple[Slice, EventStack]]:
        """Each slice with its events in the rectified image."""
        for part in self._slices():
            with self.stopwatch.stage("placing"):
                placed = self.placed.slice(part)
            yield part, placed

    def _stacks(self) -> Generator[Stacked]:
        """Each slice with the stack it is the middle of."""
        half = STACKED // 2
        for row in in_stacks(self._placed(), None, length=STACKED):
            if (middle := row[half]) is not None:
                near = row[half - 1 : half + 2] if self.labels_events else [middle]
                window = joined([each[0].events for each in near if each is not None])
                yield Stacked(middle[0], window, stacked([each and each[1] for each in row]))


def _camera_of(events: EventFile, camera: Camera | None) -> tuple[Camera, str]:
    """The camera to use, and where it comes from."""
    if camera is not None:
        source = "given"
    elif events.camera is not None:
        camera, source = events.camera.camera, f"the recording: {events.camera.source}"
    else:
        camera, source = assumed_camera(events.sensor), "assumed"
    if camera.size != events.sensor:
        sizes = [f"{size[1]}x{size[0]}" for size in (camera.size, events.sensor)]
        raise BadInput(
            f"the calibration is of a {sizes[0]} sensor, the recording of {sizes[1]}",
            fix="the calibration of the camera that recorded it",
        )
    return camera, source
