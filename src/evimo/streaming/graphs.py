"""The exported networks' files: ONNX, run by ONNX Runtime. No torch."""

import json
import os
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile, NotFound
from evimo.jobs.crew import cores

F4 = NDArray[np.float32]

MOST_WORKERS = 4  # more would wait for memory, not for each other
LARGEST_STRIDE = 1024
FIRST_PASS = ".first.onnx"


def presets() -> dict[str, Path]:
    """Models inside the package: name to ONNX file."""
    folder = Path(str(files("evimo"))) / "model" / "weights"
    return {path.stem: path for path in sorted(folder.glob("*.onnx")) if not path.name.endswith(FIRST_PASS)}


def workers_here(wanted: int | None) -> int:
    """How many slices may run side by side: as wanted, or one per core of this process, at most four."""
    return wanted or min(MOST_WORKERS, cores())


class Graph:
    """One opened file.

    name:   of the model, as the user gave it. path, content: of the file.
    inputs: the names of what it wants.
    """

    def __init__(self, path: Path, *, name: str, threads: int) -> None:
        """Open a file that exists.

        Raises:
            BadFile: not an ONNX model.
        """
        self.path, self.name, self.content = path, name, path.read_bytes()
        self._session = _session(path, self.content, threads)
        self.inputs = {node.name for node in self._session.get_inputs()}

    def checked(self, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> tuple[dict[str, Any], int]:
        """Make sure that it is one of ours, and of that kind.

        Returns:
            what the model was trained as, and the stride: sides of the rectified image are padded to multiples of it.

        Raises:
            BadFile: it lacks one of these, or wants more, or does not tell its configuration.
        """
        _check_names(self.path, self._session, (inputs, outputs))
        return _facts(self.path, self._session)

    def run(self, outputs: tuple[str, ...], feeds: dict[str, F4]) -> list[F4]:
        """What it says of one sample, without the batch axis; feeds have none either."""
        return [each[0] for each in self._session.run(outputs, {name: fed[None] for name, fed in feeds.items()})]


def open_graph(name_or_path: str | Path, *, threads: int = 1) -> Graph:
    """Open a preset by name, or an ONNX file by path; `threads` run inside one operator.

    Raises:
        NotFound: no such preset or file.
        BadFile: not an ONNX model.
    """
    path = presets().get(str(name_or_path)) or Path(name_or_path)
    if not path.is_file():
        known = ", ".join(presets()) or "none is installed"
        raise NotFound(
            f"no model {str(name_or_path)!r}",
            fix=f"a preset ({known}), classical, which needs no weights, or the path of an .onnx file",
        )
    return Graph(path, name=str(name_or_path), threads=threads)


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
