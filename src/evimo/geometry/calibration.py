"""Calibration files to cameras: kalibr YAML, ROS camera_info YAML, EV-IMO calib.txt, DV XML."""

import math
import re
import reprlib
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast
from xml.etree import ElementTree

import yaml

from evimo.errors import BadFile, BadInput, EvimoWarning, NotFound
from evimo.geometry.camera import Camera, Lens

LARGEST_FILE = 100_000  # bytes; calibrations are a few kilobytes
LENSES: dict[str, Lens] = {
    "radtan": "radtan",
    "plumb_bob": "radtan",
    "radial-tangential": "radtan",
    "equidistant": "fisheye",
    "equi": "fisheye",
    "fisheye": "fisheye",
}
NO_LENS = ("none", "", None)
FORMATS = "a kalibr or ROS camera YAML, an EV-IMO calib.txt (fx fy cx cy k1 k2 p1 p2) or a DV calibration XML"
Size = tuple[int, int]


def load_camera(path: str | Path, *, size: Size | None = None) -> Camera:
    """The camera that a calibration file describes. The format is recognised from the content.

    Args:
        path: kalibr YAML (a single camera or a camchain), ROS camera_info YAML, EV-IMO `calib.txt` (its size and lens
            are in a `params.txt` beside it, where there is one) or the XML that DV writes (k1 k2 p1 p2 k3, or fisheye).
        size: height and width of the sensor in px. Picks among the cameras of one file; needed where the file has none.

    Raises:
        NotFound: no such file.
        BadFile: not a calibration, truncated, or with impossible values.
        BadInput: the size is not in the file and not given, or differs from the file's.
    """
    path = Path(path)
    text = _text(path)
    if text.lstrip().startswith("<"):
        found = _from_xml(path, text)
    elif len(numbers := text.split()) and all(_is_number(number) for number in numbers):
        found = {path.stem: _from_calib_txt(path, [float(number) for number in numbers], size)}
    else:
        found = _from_yaml(path, text)
    if not found:
        raise BadFile(f"{path}: no camera found in it", fix=f"give {FORMATS}")
    return _picked(path, found, size)


def _text(path: Path) -> str:
    if not path.is_file():
        raise NotFound(f"no calibration file {path}", fix="check the path")
    if path.stat().st_size > LARGEST_FILE:
        raise BadFile(f"{path}: {path.stat().st_size} bytes are too many for a calibration", fix=f"give {FORMATS}")
    try:
        return path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise BadFile(f"{path}: not a text file", fix=f"give {FORMATS}") from error


def _picked(path: Path, found: Mapping[str, Camera], size: Size | None) -> Camera:
    """The camera of that size, the first if there are several: then with a warning."""
    fitting = {name: camera for name, camera in found.items() if size is None or camera.size == size}
    if not fitting:
        sizes = ", ".join(f"{camera.width}x{camera.height}" for camera in found.values())
        wanted = f"{size[1]}x{size[0]}" if size else ""
        raise BadInput(
            f"{path}: calibrated for {sizes}, but the sensor is {wanted}", fix="the calibration of this sensor"
        )
    (name, camera), *others = fitting.items()
    if others:
        rest = ", ".join(other for other, _ in others)
        warnings.warn(f"{path}: using camera {name}; {rest} would fit too", EvimoWarning, stacklevel=3)
    return camera


def _camera(path: Path, matrix: Sequence[float], size: Size, *, distortion: Sequence[float], lens: Any) -> Camera:
    """A camera from (fx, fy, cx, cy) and a lens by any of its names; a file's error where the values are impossible."""
    if not isinstance(lens, str | None) or (lens not in LENSES and lens not in NO_LENS):
        raise BadFile(f"{path}: unknown lens model {_shown(lens)}", fix=f"one of {', '.join(LENSES)}, none")
    if len(matrix) != 4:
        raise BadFile(f"{path}: {len(matrix)} intrinsics instead of fx fy cx cy", fix="calibrate as a pinhole camera")
    fx, fy, cx, cy = matrix
    kind = LENSES.get(lens or "", "radtan")
    coefficients = tuple(distortion) if lens in LENSES else ()
    try:
        return Camera(fx, fy, cx, cy, *size, coefficients, kind)
    except BadInput as error:
        raise BadFile(f"{path}: {error.problem}", fix=error.fix) from error


# YAML


def _from_yaml(path: Path, text: str) -> dict[str, Camera]:
    content = re.sub(r"\A%YAML:1\.0\s*(---)?", "", text)  # OpenCV's header is not quite YAML's
    try:
        tree: Any = yaml.safe_load(content)
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise BadFile(f"{path}: not YAML ({str(error).splitlines()[0]})", fix=f"give {FORMATS}") from error
    if not isinstance(tree, dict):
        raise BadFile(f"{path}: not a calibration", fix=f"give {FORMATS}")
    branches = cast("dict[str, Any]", tree)
    cameras = {"camera": branches} | {
        str(name): branch for name, branch in branches.items() if isinstance(branch, dict)
    }
    found: dict[str, Camera] = {}
    for name, branch in cameras.items():
        if "intrinsics" in branch:
            found[name] = _from_kalibr(path, branch)
        elif "camera_matrix" in branch:
            found[name] = _from_ros(path, branch)
    return found


def _from_kalibr(path: Path, branch: Mapping[str, Any]) -> Camera:
    if branch.get("camera_model", "pinhole") != "pinhole":
        raise BadFile(
            f"{path}: camera model {_shown(branch['camera_model'])}",
            fix="calibrate with kalibr's pinhole-radtan or pinhole-equi",
        )
    width, height = _sizes(path, branch.get("resolution"))
    distortion = _numbers(path, branch.get("distortion_coeffs", []))
    lens = branch.get("distortion_model", "radtan" if distortion else "none")
    matrix = _numbers(path, branch["intrinsics"])
    return _camera(path, matrix, (height, width), distortion=distortion, lens=lens)


def _from_ros(path: Path, branch: Mapping[str, Any]) -> Camera:
    width, height = _sizes(path, [branch.get("image_width"), branch.get("image_height")])
    matrix = _pinhole(path, _numbers(path, _values(branch["camera_matrix"])))
    distortion = _numbers(path, _values(branch.get("distortion_coefficients", [])))
    lens = branch.get("distortion_model", "radtan" if distortion else "none")
    return _camera(path, matrix, (height, width), distortion=distortion, lens=lens)


def _values(matrix: Any) -> Any:
    return cast("dict[str, Any]", matrix).get("data") if isinstance(matrix, dict) else matrix


# EV-IMO


def _from_calib_txt(path: Path, numbers: Sequence[float], size: Size | None) -> Camera:
    """`fx fy cx cy` and four coefficients, the last two p1 p2 as their maintainer says."""
    if len(numbers) != 8:
        raise BadFile(f"{path}: {len(numbers)} numbers instead of fx fy cx cy k1 k2 p1 p2", fix=f"give {FORMATS}")
    params = dict(re.findall(r"^\s*(\w+)\s*:\s*(\S+)", _beside(path), re.MULTILINE))
    if "res_x" in params and "res_y" in params:  # there, x counts rows
        columns, rows = _sizes(path.with_name("params.txt"), [params["res_y"], params["res_x"]])
        size_there = rows, columns
    elif size is None:
        raise BadInput(f"{path}: it does not say the size of its sensor", fix="the sensor's size, --sensor WxH")
    else:
        size_there = size
    lens = params.get("dist_model", "radtan")
    return _camera(path, numbers[:4], size_there, distortion=numbers[4:], lens=lens)


def _beside(path: Path) -> str:
    params = path.with_name("params.txt")
    return _text(params) if params.is_file() else ""


# DV


def _from_xml(path: Path, text: str) -> dict[str, Camera]:
    if "<!" in text.replace("<!--", ""):  # a DOCTYPE or ENTITY: never in a calibration, sometimes an attack
        raise BadFile(f"{path}: XML with declarations", fix=f"give {FORMATS}")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise BadFile(f"{path}: broken XML ({error})", fix="copy or save the calibration again") from error
    is_fisheye = (root.findtext("use_fisheye_model") or "0").strip() not in ("0", "false")
    found: dict[str, Camera] = {}
    for branch in (root, *root):
        if branch.find("camera_matrix") is None:
            continue
        matrix = _pinhole(path, _numbers(path, (branch.findtext("camera_matrix/data") or "").split()))
        distortion = _numbers(path, (branch.findtext("distortion_coefficients/data") or "").split())
        width, height = _sizes(path, [branch.findtext("image_width"), branch.findtext("image_height")])
        lens = "fisheye" if is_fisheye else "radtan"
        kept = distortion[:4] if is_fisheye else distortion
        found[branch.tag] = _camera(path, matrix, (height, width), distortion=kept, lens=lens)
    return found


# Values from strangers


def _shown(value: Any) -> str:
    """The start of a value as text. Not repr: a short YAML file can nest aliases into a value whose text is endless."""
    brief = reprlib.Repr()
    brief.maxlevel = 2
    return brief.repr(value)


def _is_number(value: Any) -> bool:
    try:
        return isinstance(value, str | int | float) and math.isfinite(float(value))
    except (ValueError, OverflowError):
        return False


def _numbers(path: Path, values: Any) -> list[float]:
    """A flat list of finite numbers."""
    listed: list[Any] = cast("list[Any]", values) if isinstance(values, list) else [None]
    if not all(map(_is_number, listed)):
        raise BadFile(f"{path}: not a list of finite numbers: {_shown(values)}", fix=f"give {FORMATS}")
    return [float(value) for value in listed]


def _sizes(path: Path, values: Any) -> tuple[int, int]:
    """Two positive whole numbers, in the file's order."""
    listed = cast("list[Any]", values) if isinstance(values, list) else []
    whole = [
        int(float(value)) for value in listed if _is_number(value) and 1 <= float(value) == int(float(value)) < 100_000
    ]
    if len(whole) != 2 or len(listed) != 2:
        raise BadFile(f"{path}: no sensor size, or not a possible one: {_shown(values)}", fix="complete the file")
    return whole[0], whole[1]


def _pinhole(path: Path, matrix: Sequence[float]) -> list[float]:
    """(fx, fy, cx, cy) of a 3x3 matrix given row by row."""
    if len(matrix) != 9 or tuple(matrix[6:]) != (0, 0, 1) or matrix[1] or matrix[3]:
        raise BadFile(f"{path}: not a camera matrix: {_shown(matrix)}", fix="fx 0 cx 0 fy cy 0 0 1, row by row")
    return [matrix[0], matrix[4], matrix[2], matrix[5]]
