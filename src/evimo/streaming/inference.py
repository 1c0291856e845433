"""The networks that look twice: two ONNX files. No torch."""

import hashlib
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile, NotFound
from evimo.streaming.graphs import FIRST_PASS, Graph, open_graph, workers_here

F4 = NDArray[np.float32]

FIRST_INPUTS = ("voxels", "fits", "candidates", "valid", "intrinsics", "rotation")
FIRST_OUTPUTS = ("rel_depth", "ego", "flow")
SECOND_INPUTS = ("voxels", "fits", "valid", "intrinsics", "rotation", "taken_ego", "taken_depth", "taken_seen")
SECOND_OUTPUTS = ("moving", "rel_depth", "ego", "velocity", "flow", "confidence")


class Seen(NamedTuple):
    """What a pass looks at.

    voxels: (30, h, w) and fits (24, h', w') of `events.stack`; valid: (h', w') share of each pixel that has a sensor
    counterpart; intrinsics: (4,) fx fy cx cy of the rectified image, px; rotation: (4,) of a gyroscope, rad per
    slice, and 1, or zeros.
    """

    voxels: F4
    fits: F4
    valid: F4
    intrinsics: F4
    rotation: F4

    def feeds(self) -> dict[str, F4]:
        """By the names of the graphs' inputs."""
        return self._asdict() | {"valid": self.valid[None]}


class CameraMotion(NamedTuple):
    """What the first pass says, at a quarter of the rectified image's size (h, w).

    rel_depth: (h, w) mean 1. ego: (6,) mean depths and rad per slice.
    flow:      (2, h, w) of everything, px per slice.
    """

    rel_depth: F4
    ego: F4
    flow: F4


class Answer(NamedTuple):
    """What the networks say of one stack, at half the rectified image's size (h, w), perhaps with a margin behind it.

    moving:    (h, w) probability that a pixel shows something that moves by itself; None where that is not estimated.
    rel_depth: (h, w) mean 1.
    ego:       (6,) camera twist, mean depths/s and rad/s.
    velocity:  (3, h, w) of what is there, relative to the static world, camera axes, mean depths/s; None with `moving`.
    flow:      (2, h, w) image velocity, 1/s on the plane Z = 1.
    confidence: (h, w) how much each pixel's flow counts in the fits of the motions, 0...1.
    """

    moving: F4 | None
    rel_depth: F4
    ego: NDArray[np.float64]
    velocity: F4 | None
    flow: F4
    confidence: F4

    def cropped(self, height: int, width: int) -> "Answer":
        """Return the answer without the margin to the right and below."""
        rel_depth, flow, confidence = (
            each[..., :height, :width] for each in (self.rel_depth, self.flow, self.confidence)
        )
        moving, velocity = (
            each if each is None else each[..., :height, :width] for each in (self.moving, self.velocity)
        )
        return Answer(moving, rel_depth, self.ego, velocity, flow, confidence)


class Network:
    """A trained model ready to run.

    name:    as the user gave it.
    sha256:  of both files.
    workers: slices that may run side by side; both passes may be called from as many threads.
    config:  what it was trained as.
    stride:  sides of the rectified image are padded to multiples of it.
    """

    finds_objects = True

    def __init__(self, model: str | Path | Graph, *, workers: int | None = None, threads: int = 1) -> None:
        """Load a preset by name, or an ONNX file by path; the first pass lies beside it as `<stem>.first.onnx`.

        Args:
            model: `small`, or a path; or the second pass, opened.
            workers: how many slices may run side by side; by default one per core, at most four.
            threads: inside one operator.

        Raises:
            NotFound: no such preset or file, or no first pass beside it.
            BadFile: not an ONNX model, or not one of ours.
        """
        self._second = model if isinstance(model, Graph) else open_graph(model, threads=threads)
        self.config, self.stride = self._second.checked(SECOND_INPUTS, SECOND_OUTPUTS)
        self.name, self.workers = self._second.name, workers_here(workers)
        path = self._second.path
        beside = path.with_name(f"{path.stem}{FIRST_PASS}")
        if not beside.is_file():
            raise NotFound(
                f"{path} has no first pass beside it", fix=f"keep {beside.name} of the same training run in its folder"
            )
        self._first = Graph(beside, name=self.name, threads=threads)
        if self._first.checked(FIRST_INPUTS, FIRST_OUTPUTS) != (self.config, self.stride):
            raise BadFile(f"{beside} is the first pass of another model", fix="both files of the same training run")
        self.sha256 = hashlib.sha256(self._second.content + self._first.content).hexdigest()

    @property
    def identity(self) -> dict[str, str]:
        """What tells its results from another model's."""
        return {"sha256": self.sha256}

    def first(self, seen: Seen, candidates: F4) -> CameraMotion:
        """Run the first pass on the events as they come, at half the rectified image's size.

        candidates: (22, h, w) of local motion in them, at a quarter of it (`events.local_motion`).
        """
        feeds = seen.feeds() | {"candidates": candidates}
        rel_depth, ego, flow = self._first.run(FIRST_OUTPUTS, feeds)
        return CameraMotion(rel_depth[0], ego, flow)

    def second(self, seen: Seen, taken: CameraMotion) -> Answer:
        """Run the second pass on events that were compensated by what the first one said."""
        feeds = seen.feeds() | {"taken_ego": taken.ego, "taken_depth": taken.rel_depth[None], "taken_seen": taken.flow}
        moving, rel_depth, ego, velocity, flow, confidence = self._second.run(SECOND_OUTPUTS, feeds)
        return Answer(moving[0], rel_depth[0], ego.astype(np.float64), velocity, flow, confidence[0])
