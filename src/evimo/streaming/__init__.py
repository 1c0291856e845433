"""This room runs the networks over a recording in constant memory and writes the files that `evimo run` leaves.

ONNX Runtime runs the exported networks; there is no torch here. `pipeline` joins the stages; `regions`, `identities`
and `objects` turn the motion mask into objects that keep their ids; `layers` and `event_labels` tell which
of them each event belongs to; `outputs` writes tables, maps, labelled events and the video.
"""

from evimo.streaming.pipeline import run

__all__ = ["run"]
