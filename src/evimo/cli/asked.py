"""What `evimo run` is asked to do with each recording, and whether that has been done."""

import json
import warnings
from collections.abc import Generator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from evimo.cli.reading import Reading
from evimo.errors import EvimoWarning

if TYPE_CHECKING:
    from evimo.streaming.pipeline import Run
    from evimo.streaming.saving import Wanted

SHORT_S = 60.0  # of recording: below it the maps are written unless told otherwise


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """The options of a run.

    calibration: a file, and the name of the camera in it. dense: None for short recordings only.
    video_speed: None for no video.
    """

    model: str
    calibration: tuple[Path | None, str | None]
    reading: Reading
    start_s: float
    stop_s: float | None
    dense: bool | None
    event_labels: bool
    imu: Literal["auto", "off"]
    video_speed: float | None

    def prepared(self, recording: Path) -> "Run":
        """The run over a recording, everything checked that can be before it starts."""
        from evimo.streaming.models import model_of
        from evimo.streaming.pipeline import Run

        network = model_of(self.model)
        events = self.reading.opened(recording)
        file, name = self.calibration
        camera = None
        if file:
            from evimo.geometry.calibration import load_camera

            camera = load_camera(file, size=events.sensor, topic=events.topic, camera=name)
        return Run(events, network, camera=camera, **self._how)

    def wanted(self, run: "Run") -> "Wanted":
        """Which outputs it is to leave."""
        from evimo.streaming.saving import Wanted

        dense = run.span.length_s < SHORT_S if self.dense is None else self.dense
        return Wanted(dense=dense, video_speed=self.video_speed)

    @property
    def settings(self) -> dict[str, Any]:
        """For `summary.json`."""
        file, name = self.calibration
        return self._how | {"calibration": file and file.name, "camera": name} | self.reading.settings

    def is_done(self, recording: Path, folder: Path, identity: dict[str, str]) -> bool:
        """Whether a folder holds the whole of such a run by this version, made after the files it reads last changed.

        identity: of the model.
        """
        path = folder / "summary.json"
        with suppress(OSError, ValueError, KeyError, TypeError):
            said = json.loads(path.read_text(encoding="utf-8"))
            read = [recording, *filter(None, self.calibration[:1])]
            if said["interrupted"] or path.stat().st_mtime_ns < max(file.stat().st_mtime_ns for file in read):
                return False
            settings = self.settings | {"video_speed": self.video_speed}
            settings |= {} if self.dense is None else {"dense": self.dense}
            made = {name: said["settings"][name] for name in settings}
            model = {name: said["model"][name] for name in ("name", *identity)}
            of = said["versions"]["evimo"], said["recording"]["name"]
            return (made, model, of) == (settings, {"name": self.model} | identity, (version("evimo"), recording.name))
        return False

    @property
    def _how(self) -> dict[str, Any]:
        return {
            "start_s": self.start_s,
            "stop_s": self.stop_s,
            "event_labels": self.event_labels,
            "imu": self.imu,
        }


@contextmanager
def heard_warnings() -> Generator[list[str]]:
    """Our warnings as a list for the summary, once each; they are shown as before."""
    heard: list[str] = []
    shown = warnings.showwarning

    def show(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
        if issubclass(category, EvimoWarning) and str(message) not in heard:
            heard.append(str(message))
        shown(message, category, *where, **more)

    warnings.showwarning = show
    try:
        yield heard
    finally:
        warnings.showwarning = shown
