"""This room turns bytes into events and events into bytes: one file per format, one `open_events`, one `save_events`.

Whatever the format, packets come sorted and in constant memory, with the sensor's size and the range of times.
"""

from evimo.formats.clock import Faults
from evimo.formats.event_file import EventFile, FoundCamera
from evimo.formats.opening import open_events

__all__ = ["EventFile", "Faults", "FoundCamera", "open_events"]
