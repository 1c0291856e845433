"""The main job: packets in, estimates out, in constant memory.

One thread reads events, cuts slices and makes images; several run the networks, a slice each, from which small graphs
gain more than from threads inside one slice; the caller's own finds objects. Bounded queues join them, so an hour needs
no more memory than a second.
"""

from collections.abc import Generator, Iterator
from contextlib import closing
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from evimo.errors import BadInput
from evimo.events.events import Events, joined
from evimo.events.frames import FrameMaker, PixelTable
from evimo.events.io.event_file import EventFile
from evimo.events.slices import Slice, in_slices, in_stacks
from evimo.geometry.camera import Camera, assumed_camera
from evimo.geometry.rectification import rectified
from evimo.recordings.estimate import Estimate
from evimo.streaming.event_labels import EventLabeller
from evimo.streaming.evidence import EvidenceMaker, SliceImages, halved_mask
from evimo.streaming.inference import Answer, Network
from evimo.streaming.objects import ObjectFinder
from evimo.streaming.span import CONTEXT, span_of
from evimo.streaming.stopwatch import Stopwatch
from evimo.streaming.threads import ahead, in_parallel

AHEAD = 2  # stacks that wait for the networks


def run(
    events: EventFile,
    *,
    model: str | Path = "tiny",
    camera: Camera | None = None,
    start_s: float = 0.0,
    stop_s: float | None = None,
    event_labels: bool = False,
) -> Iterator[Estimate]:
    """Estimate depth, moving objects and motion for each complete slice of 25 ms.

    Args:
        events: from `open_events`.
        model: a preset's name, or the path of an ONNX file.
        camera: of the sensor; without it what the recording says of itself, else a guess (with a warning).
        start_s: seconds after the first event. Start and stop select slices, they never move them: slice k is
            [k·25 ms, (k + 1)·25 ms) of the recording's own clock, and its estimate is the same in any span (the ids
            of objects count from the first slice of the span).
        stop_s: seconds after the first event; None is the end.
        event_labels: give each estimate `event_labels`, and objects whose flow and velocity their events sharpened.

    Raises:
        NotFound, BadFile: the model.
        BadInput: the camera is of another size, or the span holds no complete slice.
    """
    network = Network(model)
    prepared = Run(events, network, camera=camera, start_s=start_s, stop_s=stop_s, event_labels=event_labels)
    return _estimates(prepared)


def _estimates(prepared: "Run") -> Iterator[Estimate]:
    with closing(prepared.slices()) as slices:
        for estimate, _ in slices:
            yield estimate


class _Stack(NamedTuple):
    """What one estimate is made of: a slice, its events and those of its neighbours, and five slices' images."""

    middle: Slice
    window: Events
    images: list[SliceImages]


class Run:
    """One run over a recording, prepared and checked; `slices` does it.

    span:          the slices it covers.
    rectification: between sensor pixels and the networks' image.
    camera_source: where the camera comes from: given, the recording, or assumed.
    frames:        makes event frames; counts the events that have no place in that image.
    finder:        of objects; counts them.
    stopwatch:     where the time went.
    """

    def __init__(
        self,
        events: EventFile,
        network: Network,
        *,
        camera: Camera | None = None,
        start_s: float = 0.0,
        stop_s: float | None = None,
        event_labels: bool = False,
    ) -> None:
        """See `run`."""
        self.events = events
        self.network = network
        self.span = span_of(events, start_s=start_s, stop_s=stop_s)
        camera, self.camera_source = _camera_of(events, camera)
        self.rectification = rectified(camera)
        self.rectification.warn_of_invalid()
        image = self.rectification.image
        self._maker = EvidenceMaker(image.size, stride=network.stride, reduction=network.reduction)
        self._valid = halved_mask(self.rectification.image_valid, stride=network.stride)
        self._intrinsics = np.array((image.fx, image.fy, image.cx, image.cy), np.float32)
        self.stopwatch = Stopwatch()
        self.finder = ObjectFinder(self.rectification)
        self._labeller = EventLabeller(self.rectification) if event_labels else None
        self.frames = FrameMaker(PixelTable(*self.rectification.table()))

    @property
    def labels_events(self) -> bool:
        """Whether estimates come with `event_labels`."""
        return self._labeller is not None

    def slices(self) -> Generator[tuple[Estimate, Events]]:
        """Each slice's estimate and its events; once."""
        found = self._found()
        if self._labeller is not None:
            found = in_parallel(partial(self._labelled, self._labeller), found, workers=self.network.workers)
        with closing(found):
            for estimate, stack in found:
                yield estimate, stack.middle.events

    def _found(self) -> Generator[tuple[Estimate, _Stack]]:
        """Each slice's estimate, without labels of events."""
        stacks = ahead(self._stacks(), depth=AHEAD)
        with closing(in_parallel(self._answer, stacks, workers=self.network.workers)) as answers:
            for stack, answer in answers:
                part = stack.middle
                with self.stopwatch.stage("objects"):
                    estimate = self.finder.estimate(answer, start_us=part.start_us, stop_us=part.stop_us)
                yield estimate, stack

    def _labelled(self, labeller: EventLabeller, found: tuple[Estimate, _Stack]) -> tuple[Estimate, _Stack]:
        estimate, stack = found
        with self.stopwatch.stage("event labels"):
            return labeller.label(estimate, stack.window), stack

    def _slices(self) -> Iterator[Slice]:
        span = self.span
        packets = self.stopwatch.over("reading", self.events.packets(span.read_start_us, span.read_stop_us))
        slices = in_slices(packets, start_us=span.read_start_us, stop_us=span.read_stop_us)
        yield from self.stopwatch.over("slicing", slices)

    def _images(self) -> Iterator[tuple[Slice, SliceImages]]:
        """Each slice with what the networks see of it."""
        frame = None
        for part in self._slices():
            with self.stopwatch.stage("frames"):
                dt_us = part.stop_us - part.start_us
                frame = self.frames.frame(part.events, start_us=part.start_us, dt_us=dt_us, out=frame)
                images = self._maker.images(frame)
            yield part, images

    def _stacks(self) -> Iterator[_Stack]:
        """The slices of the span with their stacks."""
        nothing = None, self._maker.nothing()
        for stack in in_stacks(self._images(), nothing, length=2 * CONTEXT + 1):
            middle = stack[CONTEXT][0]
            if middle is not None and self.span.first <= middle.index < self.span.last:
                near = stack[CONTEXT - 1 : CONTEXT + 2] if self.labels_events else stack[CONTEXT : CONTEXT + 1]
                window = joined([part.events for part, _ in near if part is not None])
                yield _Stack(middle, window, [images for _, images in stack])

    def _answer(self, stack: _Stack) -> tuple[_Stack, Answer]:
        images = stack.images
        with self.stopwatch.stage("evidence"):
            image, evidence = self._maker.image(images), self._maker.evidence(images)
        with self.stopwatch.stage("networks"):
            return stack, self.network.estimate(image, evidence, valid=self._valid, intrinsics=self._intrinsics)


def _camera_of(events: EventFile, camera: Camera | None) -> tuple[Camera, str]:
    """The camera to use, and where it comes from."""
    if camera is not None:
        source = "given"
    elif events.camera_hint is not None:
        fields = asdict(events.camera_hint)
        source = f"the recording: {fields.pop('source')}"
        camera = Camera(**fields)
    else:
        camera, source = assumed_camera(events.sensor), "assumed"
    if camera.size != events.sensor:
        sizes = [f"{size[1]}x{size[0]}" for size in (camera.size, events.sensor)]
        raise BadInput(
            f"the calibration is of a {sizes[0]} sensor, the recording of {sizes[1]}",
            fix="the calibration of the camera that recorded it",
        )
    return camera, source
