"""Every file that a run leaves in its folder."""

import math
from contextlib import ExitStack
from typing import TypeVar

from evimo.events.events import Events
from evimo.events.slices import SLICE_US
from evimo.recordings.estimate import Estimate
from evimo.streaming.estimates_file import EstimatesFile
from evimo.streaming.events_file import EventsFile
from evimo.streaming.pipeline import Run
from evimo.streaming.tables import Tables
from evimo.streaming.threads import Background
from evimo.viewing.panels import Panels
from evimo.viewing.video import VideoWriter
from evimo.writing import OutputFolder

Output = TypeVar("Output", Tables, EstimatesFile, EventsFile, "Video")

OPTIONAL = ("objects.csv", "estimates.h5", "events.h5", "video.mp4")
FASTEST_FPS = 60.0  # players drop images beyond their screen's rate: rather leave out slices


class Outputs:
    """Takes estimates slice by slice and writes the tables, and where wanted maps, labelled events and the video."""

    def __init__(self, folder: OutputFolder, run: Run, *, dense: bool, video_speed: float | None) -> None:
        """Open the files.

        Args:
            folder: where to.
            run: that makes the estimates; if it labels events, `events.h5` is written.
            dense: write `estimates.h5`.
            video_speed: of `video.mp4`, 1 being real time; None for no video.
        """
        self._watch = run.stopwatch
        self._open = ExitStack()
        self._tables = self._opened(
            Tables(folder.path("egomotion.csv"), folder.path("objects.csv") if run.network.finds_objects else None)
        )
        self._maps = self._events = self._video = None
        network = run.network
        about = {"recording": run.events.path.name, "model": network.name}
        about |= {f"model_{key}": value for key, value in network.identity.items()}
        try:
            self._open_wanted(folder, run, about=about, dense=dense, video_speed=video_speed)
        except BaseException:
            self.close()
            raise

    def _open_wanted(
        self, folder: OutputFolder, run: Run, *, about: dict[str, str], dense: bool, video_speed: float | None
    ) -> None:
        if dense:
            path, valid = folder.path("estimates.h5"), run.rectification.valid
            maps = EstimatesFile(path, valid, attributes=about, watch=run.stopwatch, objects=run.network.finds_objects)
            self._maps = self._opened(maps)
        if run.labels_events:
            events = EventsFile(folder.path("events.h5"), attributes=about, watch=run.stopwatch)
            self._events = self._opened(events)
        if video_speed is not None:
            self._video = self._opened(Video(folder, run, speed=video_speed))

    def write(self, estimate: Estimate, events: Events) -> None:
        """Add one slice."""
        with self._watch.stage("tables"):
            self._tables.write(estimate)
        if self._maps:
            with self._watch.stage("waiting for maps"):
                self._maps.write(estimate)
        if self._events and estimate.event_labels:
            with self._watch.stage("waiting for events"):
                self._events.write(estimate.event_labels)
        if self._video:
            with self._watch.stage("waiting for video"):
                self._video.write(estimate, events)

    def close(self) -> None:
        """Complete every file."""
        self._open.close()

    def _opened(self, output: Output) -> Output:
        self._open.callback(output.close)
        return output


class Video:
    """`video.mp4`, drawn and encoded in a thread of its own."""

    def __init__(self, folder: OutputFolder, run: Run, *, speed: float) -> None:
        """Start it; `speed` 1 is real time, 0.25 four times slower."""
        fps = speed * 1e6 / SLICE_US
        self._every = max(1, math.ceil(fps / FASTEST_FPS))
        self._writer = VideoWriter(folder.path("video.mp4"), fps=fps / self._every)
        self._panels, self._watch = Panels(run.events.sensor), run.stopwatch
        self._origin_us = run.events.start_us
        self._count = 0
        self._background = Background(self._draw)

    def write(self, estimate: Estimate, events: Events) -> None:
        """Hand over one slice."""
        if self._count % self._every == 0:
            self._background.put((estimate, events))
        self._count += 1

    def close(self) -> None:
        """Wait for the last image, and finish the file."""
        try:
            self._background.close()
        finally:
            self._writer.close()

    def _draw(self, item: tuple[Estimate, Events]) -> None:
        estimate, events = item
        with self._watch.stage("drawing"):
            image = self._panels.draw(estimate, events, time_origin_us=self._origin_us)
        with self._watch.stage("encoding"):
            self._writer.write(image)
