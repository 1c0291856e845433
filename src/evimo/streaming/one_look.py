"""`--model ecn`: the paper's rival, which looks once, in the place of the networks that look twice.

It knows the camera's motion and the depth of what it sees, and nothing of what moves by itself.
"""

import hashlib
from collections.abc import Callable, Generator

import numpy as np

from evimo.formats.event_file import EventFile
from evimo.geometry.rectification import Rectification
from evimo.streaming.graphs import Graph, workers_here
from evimo.streaming.inference import Answer, Seen
from evimo.streaming.looks import Looks
from evimo.streaming.passes import Stacked, near
from evimo.streaming.rotation import UNKNOWN, Rotation
from evimo.streaming.span import Span
from evimo.streaming.stopwatch import Stopwatch
from evimo.streaming.threads import in_parallel

ONLY_INPUTS = ("voxels", "valid", "intrinsics")
ONLY_OUTPUTS = ("rel_depth", "ego", "flow", "confidence")


def looks_once(graph: Graph) -> bool:
    """Whether the opened file is such a network's; what else it may be, `Network` says."""
    return graph.inputs == set(ONLY_INPUTS)


class OneLookNetwork:
    """A trained model ready to run, as `Network`; it has one file, and finds no objects."""

    finds_objects = False

    def __init__(self, graph: Graph, *, workers: int | None = None) -> None:
        """Raises BadFile where the opened file is not one of ours."""
        self.config, self.stride = graph.checked(ONLY_INPUTS, ONLY_OUTPUTS)
        self.name, self.workers = graph.name, workers_here(workers)
        self.sha256 = hashlib.sha256(graph.content).hexdigest()
        self._graph = graph

    @property
    def identity(self) -> dict[str, str]:
        """What tells its results from another model's."""
        return {"sha256": self.sha256}

    def only(self, seen: Seen) -> Answer:
        """Run it on the events as they come, at half the rectified image's size."""
        feeds = seen.feeds()
        said = self._graph.run(ONLY_OUTPUTS, {name: feeds[name] for name in ONLY_INPUTS})
        rel_depth, ego, flow, confidence = said
        return Answer(None, rel_depth[0], ego.astype(np.float64), None, flow, confidence[0])


class OneLook:
    """Such a network over a recording's stacks, slice by slice; beside `TwoPasses`."""

    def __init__(self, network: OneLookNetwork, rectification: Rectification, stopwatch: Stopwatch) -> None:
        self._network, self._stopwatch = network, stopwatch
        self._looks = Looks(rectification, stride=network.stride)

    def answers(
        self, stacks: Generator[Stacked], span: Span, rotation: Rotation
    ) -> Generator[tuple[Stacked, Answer | None]]:
        """Each slice of the span, and a neighbour to each side, with what the network says of it if it has events."""
        return in_parallel(self._answered, near(stacks, span), workers=self._network.workers)

    def rotation(self, events: EventFile, stacks: Callable[[], Generator[Stacked]]) -> Rotation:
        """What is known of the camera's rotation: nothing is taken from gyroscopes."""
        return Rotation(None, f"not used: {self._network.name} sees the events alone")

    def _answered(self, stacked: Stacked) -> tuple[Stacked, Answer | None]:
        if not len(stacked.part.events):
            return stacked, None
        with self._stopwatch.stage("look"):
            seen = self._looks.first(stacked.stack, UNKNOWN)
        with self._stopwatch.stage("network"):
            return stacked, self._network.only(seen)
