"""Simulated recordings as training reads them, without a file in between."""

from collections.abc import Iterator

from evimo.events.slices import SLICE_US, Slice
from evimo.recordings.prepared import Prepared, prepared_in_memory
from evimo.recordings.truth import Truth
from evimo.simulate.recording import SimulatedRecording


def filmed(recording: SimulatedRecording) -> Prepared:
    """Film a recording on its device, into arrays in memory."""
    return prepared_in_memory(recording.camera, _slices(recording))


def _slices(recording: SimulatedRecording) -> Iterator[tuple[Slice, Truth]]:
    for index, piece in enumerate(recording):
        yield Slice(index, index * SLICE_US, (index + 1) * SLICE_US, piece.events), piece.truth
