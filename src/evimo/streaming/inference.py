"""The exported networks: two ONNX files, run by ONNX Runtime. No torch."""

import hashlib
import json
import os
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile, NotFound
from evimo.jobs.crew import cores

F4 = NDArray[np.float32]

MOST_WORKERS = 4  # more would wait for memory, not for each other
LARGEST_STRIDE = 1024
FIRST_PASS = ".first.onnx"
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
        return {
            "voxels": self.voxels[None],
            "fits": self.fits[None],
            "valid": self.valid[None, None],
            "intrinsics": self.intrinsics[None],
            "rotation": self.rotation[None],
        }


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

    moving:    (h, w) probability that a pixel shows something that moves by itself.
    rel_depth: (h, w) mean 1.
    ego:       (6,) camera twist, mean depths/s and rad/s.
    velocity:  (3, h, w) of what is there, relative to the static world, camera axes, mean depths/s.
    flow:      (2, h, w) image velocity, 1/s on the plane Z = 1.
    confidence: (h, w) how much each pixel's flow counts in the fits of the motions, 0...1.
    """

    moving: F4
    rel_depth: F4
    ego: NDArray[np.float64]
    velocity: F4
    flow: F4
    confidence: F4

    def cropped(self, height: int, width: int) -> "Answer":
        """Return the answer without the margin to the right and below."""
        moving, rel_depth, velocity, flow, confidence = (
            each[..., :height, :width]
            for each in (self.moving, self.rel_depth, self.velocity, self.flow, self.confidence)
        )
        return Answer(moving, rel_depth, self.ego, velocity, flow, confidence)


def presets() -> dict[str, Path]:
    """Models inside the package: name to ONNX file."""
    folder = Path(str(files("evimo"))) / "model" / "weights"
    return {path.stem: path for path in sorted(folder.glob("*.onnx")) if not path.name.endswith(FIRST_PASS)}


def workers_here(wanted: int | None) -> int:
    """How many slices may run side by side: as wanted, or one per core of this process, at most four."""
    return wanted or min(MOST_WORKERS, cores())


class Network:
    """A trained model ready to run.

    name:    as the user gave it.
    sha256:  of both files.
    workers: slices that may run side by side; both passes may be called from as many threads.
    config:  what it was trained as.
    stride:  sides of the rectified image are padded to multiples of it.
    """

    def __init__(self, name_or_path: str | Path, *, workers: int | None = None, threads: int = 1) -> None:
        """Load a preset by name, or an ONNX file by path; the first pass lies beside it as `<stem>.first.onnx`.

        Args:
            name_or_path: `small`, or a path.
            workers: how many slices may run side by side; by default one per core, at most four.
            threads: inside one operator.

        Raises:
            NotFound: no such preset or file, or no first pass beside it.
            BadFile: not an ONNX model, or not one of ours.
        """
        self.name = str(name_or_path)
        self.workers = workers_here(workers)
        path = presets().get(self.name) or Path(name_or_path)
        if not path.is_file():
            known = ", ".join(presets()) or "none is installed"
            raise NotFound(
                f"no model {self.name!r}",
                fix=f"a preset ({known}), classical, which needs no weights, or the path of an .onnx file",
            )
        content = path.read_bytes()
        self._second = _session(path, content, threads)
        _check_names(path, self._second, (SECOND_INPUTS, SECOND_OUTPUTS))
        self.config, self.stride = _facts(path, self._second)
        beside = path.with_name(f"{path.stem}{FIRST_PASS}")
        if not beside.is_file():
            raise NotFound(
                f"{path} has no first pass beside it", fix=f"keep {beside.name} of the same training run in its folder"
            )
        first = beside.read_bytes()
        self.sha256 = hashlib.sha256(content + first).hexdigest()
        self._first = _session(beside, first, threads)
        _check_names(beside, self._first, (FIRST_INPUTS, FIRST_OUTPUTS))
        if _facts(beside, self._first) != (self.config, self.stride):
            raise BadFile(f"{beside} is the first pass of another model", fix="both files of the same training run")

    @property
    def identity(self) -> dict[str, str]:
        """What tells its results from another model's."""
        return {"sha256": self.sha256}

    def first(self, seen: Seen, candidates: F4) -> CameraMotion:
        """Run the first pass on the events as they come, at half the rectified image's size.

        candidates: (22, h, w) of local motion in them, at a quarter of it (`events.local_motion`).
        """
        feeds = seen.feeds() | {"candidates": candidates[None]}
        rel_depth, ego, flow = self._first.run(FIRST_OUTPUTS, feeds)
        return CameraMotion(rel_depth[0, 0], ego[0], flow[0])

    def second(self, seen: Seen, taken: CameraMotion) -> Answer:
        """Run the second pass on events that were compensated by what the first one said."""
        feeds = seen.feeds() | {
            "taken_ego": taken.ego[None],
            "taken_depth": taken.rel_depth[None, None],
            "taken_seen": taken.flow[None],
        }
        moving, rel_depth, ego, velocity, flow, confidence = self._second.run(SECOND_OUTPUTS, feeds)
        ego = ego[0].astype(np.float64)
        return Answer(moving[0, 0], rel_depth[0, 0], ego, velocity[0], flow[0], confidence[0, 0])


def _runtime() -> Any:
    """ONNX Runtime, told before it is loaded to report nothing to its makers, for which it also wants a home."""
    os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")
    import onnxruntime

    return onnxruntime


def _session(path: Path, content: bytes, threads: int) -> Any:
    ort = _runtime()
    options = ort.SessionOptions()
    options.intra_op_num_threads = threads
    options.log_severity_level = 3  # its warnings concern its makers
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")  # the cores are shared with reading
    try:
        return ort.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # ONNX Runtime's own errors have no common parent
        reason = str(error).strip().splitlines()[0]
        raise BadFile(f"{path} is not an ONNX model: {reason}", fix="the .onnx file of a training run") from error


def _check_names(path: Path, session: Any, names: tuple[tuple[str, ...], tuple[str, ...]]) -> None:
    given = {node.name for node in session.get_inputs()}, {node.name for node in session.get_outputs()}
    missing = [name for ours, found in zip(names, given, strict=True) for name in ours if name not in found]
    if missing or len(given[0]) > len(names[0]):
        lacks = f"lacks {', '.join(missing)}" if missing else f"wants more than {', '.join(names[0])}"
        raise BadFile(
            f"{path} is not an evimo model: it {lacks}", fix="the .onnx file of `evimo train`, exported by this version"
        )


def _facts(path: Path, session: Any) -> tuple[dict[str, Any], int]:
    """Configuration and stride from the file's metadata."""
    texts = session.get_modelmeta().custom_metadata_map
    try:
        config, stride = (json.loads(texts[key]) for key in ("config", "stride"))
        if not isinstance(config, dict) or not 4 <= stride < LARGEST_STRIDE or stride % 4:
            raise ValueError(f"stride {stride}")
    except (KeyError, ValueError, TypeError) as error:
        raise BadFile(
            f"{path} does not say how its images are made: {error}", fix="the .onnx file of `evimo train`"
        ) from error
    return config, stride
