"""The exported networks: an ONNX file, run by ONNX Runtime. No torch."""

import hashlib
import json
import os
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import onnxruntime as ort
from numpy.typing import NDArray

from evimo.errors import BadFile, NotFound

F4 = NDArray[np.float32]

MOST_WORKERS = 4  # more would wait for memory, not for each other
INPUTS = ("frames", "valid", "intrinsics")
OUTPUTS = ("moving", "rel_depth", "ego", "velocity", "flow")


class Answer(NamedTuple):
    """What the networks say of one stack, in the rectified image (h, w).

    moving:    (h, w) probability that a pixel shows something that moves by itself.
    rel_depth: (h, w) mean 1.
    ego:       (6,) camera twist, mean depths/s and rad/s.
    velocity:  (3, h, w) of what moves there, relative to the static world, camera axes, mean depths/s.
    flow:      (2, h, w) image velocity, 1/s on the plane Z = 1.
    """

    moving: F4
    rel_depth: F4
    ego: NDArray[np.float64]
    velocity: F4
    flow: F4


def presets() -> dict[str, Path]:
    """Models inside the package: name to ONNX file."""
    folder = Path(str(files("evimo"))) / "model" / "weights"
    return {path.stem: path for path in sorted(folder.glob("*.onnx"))}


class Network:
    """A trained model ready to run.

    name:    as the user gave it.
    sha256:  of the file.
    workers: slices that may run side by side; `estimate` may be called from as many threads.
    config:  what it was trained as, from the file; empty if it does not say.
    """

    def __init__(self, name_or_path: str | Path, *, workers: int | None = None, threads: int = 1) -> None:
        """Load a preset by name, or an ONNX file by path.

        Args:
            name_or_path: `tiny`, or a path.
            workers: how many slices may run side by side; by default one per core, at most four.
            threads: inside one operator.

        Raises:
            NotFound: no such preset or file.
            BadFile: not an ONNX model, or not one of ours.
        """
        self.name = str(name_or_path)
        self.workers = workers or min(MOST_WORKERS, os.cpu_count() or 1)
        path = presets().get(self.name) or Path(name_or_path)
        if not path.is_file():
            known = ", ".join(presets()) or "none is installed"
            raise NotFound(f"no model {self.name!r}", fix=f"a preset ({known}), or the path of an .onnx file")
        content = path.read_bytes()
        self.sha256 = hashlib.sha256(content).hexdigest()
        self._session = _session(path, content, threads)
        _check_names(path, self._session)
        self.config = _config(self._session)

    def check_size(self, size: tuple[int, int]) -> None:
        """Refuse images (height, width) that the file's own fixed size excludes.

        Raises:
            BadFile: the model was exported for another size only.
        """
        fixed = {node.name: node.shape for node in self._session.get_inputs()}["frames"][-2:]
        if any(isinstance(ours, int) and ours != length for ours, length in zip(fixed, size, strict=True)):
            raise BadFile(
                f"model {self.name!r} takes images of {fixed[1]}x{fixed[0]} only, not {size[1]}x{size[0]}",
                fix="a model exported with free height and width",
            )

    def estimate(self, frames: F4, *, valid: F4, intrinsics: F4) -> Answer:
        """Run one stack.

        Args:
            frames: (5, 3, h, w) event frames, the reference slice in the middle.
            valid: (h, w) 1 where the image has a sensor counterpart, else 0.
            intrinsics: (4,) fx, fy, cx, cy of the image, px.
        """
        feeds = {"frames": frames[None], "valid": valid[None, None], "intrinsics": intrinsics[None]}
        moving, rel_depth, ego, velocity, flow = self._session.run(OUTPUTS, feeds)
        return Answer(moving[0, 0], rel_depth[0, 0], ego[0].astype(np.float64), velocity[0], flow[0])


def _session(path: Path, content: bytes, threads: int) -> Any:
    options = ort.SessionOptions()
    options.intra_op_num_threads = threads
    options.log_severity_level = 3  # its warnings concern its makers
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")  # the cores are shared with reading
    try:
        return ort.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # ONNX Runtime's own errors have no common parent
        reason = str(error).strip().splitlines()[0]
        raise BadFile(f"{path} is not an ONNX model: {reason}", fix="the .onnx file of a training run") from error


def _check_names(path: Path, session: Any) -> None:
    given = {node.name for node in session.get_inputs()}, {node.name for node in session.get_outputs()}
    missing = [name for ours, names in zip((INPUTS, OUTPUTS), given, strict=True) for name in ours if name not in names]
    if missing or len(given[0]) > len(INPUTS):
        lacks = f"lacks {', '.join(missing)}" if missing else f"wants more than {', '.join(INPUTS)}"
        raise BadFile(f"{path} is not an evimo model: it {lacks}", fix="the .onnx file of `evimo train`")


def _config(session: Any) -> dict[str, Any]:
    text = session.get_modelmeta().custom_metadata_map.get("config", "{}")
    try:
        config = json.loads(text)
    except json.JSONDecodeError:
        return {}
    return config if isinstance(config, dict) else {}
