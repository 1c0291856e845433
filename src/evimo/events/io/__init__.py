"""Event recordings of every format, read alike: packets in constant memory, sensor size, time range."""

from evimo.events.io.event_file import CameraHint, EventFile, Faults
from evimo.events.io.opening import open_events

__all__ = ["CameraHint", "EventFile", "Faults", "open_events"]
