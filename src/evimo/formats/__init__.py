"""Event recordings of every format, read alike: packets in constant memory, sensor size, time range."""

from evimo.formats.clock import Faults
from evimo.formats.event_file import EventFile, FoundCamera
from evimo.formats.opening import open_events

__all__ = ["EventFile", "Faults", "FoundCamera", "open_events"]
