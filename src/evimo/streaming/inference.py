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
from evimo.streaming.span import CONTEXT

F4 = NDArray[np.float32]

MOST_WORKERS = 4  # more would wait for memory, not for each other
LARGEST_STRIDE = 1024
SLICES = 2 * CONTEXT + 1
INPUTS = ("image", "evidence", "valid", "intrinsics")
OUTPUTS = ("moving", "rel_depth", "ego", "velocity", "flow")


class Answer(NamedTuple):
    """What the networks say of one stack, at half the rectified image's size (h, w), perhaps with a margin behind it.

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

    def cropped(self, height: int, width: int) -> "Answer":
        """Without the margin to the right and below."""
        moving, rel_depth, velocity, flow = (
            each[..., :height, :width] for each in (self.moving, self.rel_depth, self.velocity, self.flow)
        )
        return Answer(moving, rel_depth, self.ego, velocity, flow)


def presets() -> dict[str, Path]:
    """Models inside the package: name to ONNX file."""
    folder = Path(str(files("evimo"))) / "model" / "weights"
    return {path.stem: path for path in sorted(folder.glob("*.onnx"))}


class Network:
    """A trained model ready to run.

    name:    as the user gave it.
    sha256:  of the file.
    workers: slices that may run side by side; `estimate` may be called from as many threads.
    config:  what it was trained as.
    stride:  sides of the images are padded to multiples of it; `reduction`: how much coarser than half the image the
        evidence is. Both are for `EvidenceMaker`.
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
        self.config, self.stride, self.reduction = _facts(path, self._session)

    def estimate(self, image: F4, evidence: F4, *, valid: F4, intrinsics: F4) -> Answer:
        """Run one stack.

        Args:
            image: (15, h, w) from `EvidenceMaker.image`.
            evidence: (22, a, b) from `EvidenceMaker.evidence`.
            valid: (h, w) share of each pixel that has a sensor counterpart.
            intrinsics: (4,) fx, fy, cx, cy of the whole image, px.
        """
        feeds = {
            "image": image[None],
            "evidence": evidence[None],
            "valid": valid[None, None],
            "intrinsics": intrinsics[None],
        }
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
        raise BadFile(
            f"{path} is not an evimo model: it {lacks}", fix="the .onnx file of `evimo train`, exported by this version"
        )


def _facts(path: Path, session: Any) -> tuple[dict[str, Any], int, int]:
    """Configuration, stride and reduction from the file's metadata."""
    texts = session.get_modelmeta().custom_metadata_map
    try:
        config, stride, reduction = (json.loads(texts[key]) for key in ("config", "stride", "evidence_reduction"))
        if not isinstance(config, dict) or not 0 < reduction < stride < LARGEST_STRIDE or stride % (2 * reduction):
            raise ValueError(f"stride {stride}, reduction {reduction}")
        if config.get("slices", SLICES) != SLICES:
            raise ValueError(f"stacks of {config['slices']} slices, not of {SLICES}")
    except (KeyError, ValueError, TypeError) as error:
        raise BadFile(
            f"{path} does not say how its images are made: {error}", fix="the .onnx file of `evimo train`"
        ) from error
    return config, stride, reduction
