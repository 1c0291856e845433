"""The options of every command that opens recordings: what the user says of a file that does not tell it itself."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from cyclopts import Parameter

from evimo.formats.time_units import TimeUnit

if TYPE_CHECKING:
    from evimo.formats.event_file import EventFile


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """How recordings are read where they do not tell.

    Args:
        sensor: width x height in pixels, as in 346x260, where the file does not tell.
        time_unit: of the file's times, where they are plain numbers; guessed and checked by default.
        columns: the order of a table's columns, a letter each, as in txyp; _ leaves one out.
        topic: of the events, in a file that holds those of several cameras.
    """

    sensor: str | None = None
    time_unit: TimeUnit | None = None
    columns: str | None = None
    topic: str | None = None

    def opened(self, path: Path) -> "EventFile":
        """Open a recording with these options.

        Raises:
            EvimoError: it cannot be read, or an option is none.
        """
        from evimo.formats.opening import open_events
        from evimo.formats.sensors import sensor_size

        sensor = sensor_size(self.sensor) if self.sensor else None
        return open_events(path, sensor=sensor, time_unit=self.time_unit, columns=self.columns, topic=self.topic)

    @property
    def settings(self) -> dict[str, str | None]:
        """The options by their names, to be kept beside results."""
        return asdict(self)


AS_TOLD = Reading()
