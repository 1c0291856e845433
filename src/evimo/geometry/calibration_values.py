"""What the branches of a calibration file say of a camera, under the names that programs give to the same numbers."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from evimo.errors import BadFile, BadInput
from evimo.geometry.calibration_lenses import first_of, lens_kind, told_lens
from evimo.geometry.calibration_numbers import numbers, pinhole, sizes
from evimo.geometry.calibration_trees import Tree
from evimo.geometry.camera import COEFFICIENTS, Camera

Size = tuple[int, int]
MOST_LISTED = 64  # cameras in a list
DEEPEST = 4  # DSEC has its cameras one level down, dv-processing two
MATRICES = (
    *("camera_matrix", "intrinsics", "K", "k", "cameraMatrix", "Camera_Matrix", "CameraMatrix", "intrinsic"),
    *("intrinsic_matrix", "mtx", "projection_parameters"),
)
SIZES = ("resolution", "image_size", "img_size", "size", "ImageSize", "imageSize")  # columns, rows
COLUMNS = ("image_width", "image_Width", "imageWidth", "width")
ROWS = ("image_height", "image_Height", "imageHeight", "height")
# Focal lengths of a sensor's longer side, to be divided and multiplied by: no lens is such.
WIDEST, NARROWEST = 20, 1000
STEREO = ("M", "K")  # M1 D1 M2 D2 of OpenCV's stereo sample: neither size nor names


@dataclass(frozen=True, slots=True)
class Described:
    """One camera as a file describes it, its values not yet looked at.

    names:  what it is called there, the first being its place in the file.
    matrix: fx fy cx cy, or 3x3.
    lens:   by any of its names; None where the file does not tell: then coefficients are those of radtan.
    topic:  that of its images.
    """

    path: Path
    names: tuple[str, ...]
    matrix: Any
    size: Size | None = None
    distortion: Any = ()
    lens: Any = None
    topic: str = ""

    @property
    def title(self) -> str:
        """Its names, for a list."""
        others = ", ".join(dict.fromkeys(name for name in (*self.names[1:], self.topic) if name))
        return f"{self.names[0]} ({others})" if others else self.names[0]

    def camera(self, size: Size | None) -> Camera:
        """The camera, with the sensor's size where the file has none.

        Raises:
            BadFile: impossible values.
            BadInput: no size, or the centre of the image lies outside it.
        """
        where = f"{self.path}, {self.names[0]}"
        distortion = numbers(where, self.distortion)
        lens = ("radtan" if distortion else "none") if self.lens in (None, "") else self.lens
        try:
            kind = lens_kind(lens)
        except BadInput as error:
            raise BadFile(f"{where}: {error.problem}", fix=error.fix) from error
        if kind == "fisheye" and not distortion:
            raise BadFile(f"{where}: its lens, {lens}, has no coefficients", fix="complete the file: k1 k2 k3 k4")
        matrix = pinhole(where, numbers(where, self.matrix))
        sensor = self.size or size
        if sensor is None:
            raise BadInput(f"{where}: it does not say the size of its sensor", fix="the sensor's size, --sensor WxH")
        try:
            camera = camera_of(matrix, sensor, lens=lens, distortion=distortion)
        except BadInput as error:
            raise BadFile(f"{where}: {error.problem}", fix=error.fix) from error
        if impossible := _impossible(camera):
            raise BadInput(f"{where}: {impossible}", fix="the calibration of this sensor, in px")
        return camera


def _impossible(camera: Camera) -> str:
    """What of a camera's numbers belongs to another sensor, or to another unit than px; nothing where all fit."""
    title, longest = f"a sensor of {camera.width}x{camera.height}", max(camera.size)
    if not (0 < camera.cx < camera.width and 0 < camera.cy < camera.height):
        return f"the image's centre {camera.cx:g}, {camera.cy:g} is not on {title}"
    if min(camera.fx, camera.fy) * WIDEST < longest or max(camera.fx, camera.fy) > NARROWEST * longest:
        return f"focal lengths of {camera.fx:g} and {camera.fy:g} px are impossible on {title}"
    return ""


def camera_of(matrix: Sequence[float], size: Size, *, lens: Any, distortion: Sequence[float]) -> Camera:
    """A camera from (fx, fy, cx, cy) and a lens by any of its names.

    Raises:
        BadInput: an unknown lens, or impossible values.
    """
    kind = lens_kind(lens)
    if kind is None and any(distortion):
        raise BadInput(f"no lens ({lens}), but {len(distortion)} coefficients", fix="name it: radtan or equidistant")
    most = max(COEFFICIENTS[kind or "radtan"])
    if any(distortion[most:]):
        raise BadInput(
            f"a {kind} lens with {len(distortion)} coefficients", fix=f"calibrate with at most {most} (OpenCV's order)"
        )
    fx, fy, cx, cy = matrix
    return Camera(fx, fy, cx, cy, *size, tuple(distortion[:most]) if kind else (), kind or "radtan")


def described_cameras(path: Path, tree: Tree) -> list[Described]:
    """All cameras of a file, in its order."""
    found: list[Described] = []
    for key, branch in _branches("camera", tree, depth=0, seen=set()):
        if isinstance(cameras := branch.get("intrinsics"), list) and cameras and isinstance(cameras[0], dict):
            found += _basalt(path, branch, cast("list[Any]", cameras))
        elif (matrix := first_of(branch, MATRICES)) is not None and _is_matrix(matrix):
            found.append(_described(path, key, branch, tree, matrix))
        elif {"focalLength", "principalPoint"} <= branch.keys():
            halves = [numbers(f"{path}, {key}", branch[half]) for half in ("focalLength", "principalPoint")]
            found.append(_described(path, key, branch, tree, halves[0] + halves[1]))
        elif {"fx", "fy", "cx", "cy"} <= branch.keys():
            found.append(_described(path, key, branch, tree, branch))
        else:
            found += _stereo(path, branch)
    return found


def _branches(key: str, branch: Tree, *, depth: int, seen: set[int]) -> Iterator[tuple[str, Tree]]:
    """The mappings of a tree with their keys, outer ones first, each once: aliases can nest a small file endlessly.

    What lies inside a camera is no camera.
    """
    seen.add(id(branch))
    yield key, branch
    matrix = first_of(branch, MATRICES)
    if depth == DEEPEST or _is_matrix(matrix):
        return
    for name, inner in branch.items():
        for number, each in enumerate(_mappings(name, inner)):
            if id(each) not in seen:
                listed = f"cam{number}" if name == "cameras" else f"{name}{number}"
                known = key if name == "camera" else str(name)  # SVO's lists hold a `camera` each
                yield from _branches(listed if isinstance(inner, list) else known, each, depth=depth + 1, seen=seen)


def _mappings(name: Any, inner: Any) -> list[Tree]:
    """The mappings that a value is, or lists; none of basalt's `intrinsics`, which are looked at as a whole."""
    listed = cast("list[Any]", inner[:MOST_LISTED] if isinstance(inner, list) and name != "intrinsics" else [inner])
    return [cast("Tree", each) for each in listed if isinstance(each, dict)]


def _is_matrix(value: Any) -> bool:
    """Whether a value means to be a matrix: a list, OpenCV's mapping with data, or fx fy cx cy by name.

    DSEC's `intrinsics` is a mapping of cameras.
    """
    if isinstance(value, dict):
        return bool({"data", "fx", "gamma1", "mu"} & cast("Tree", value).keys())
    return isinstance(value, list | str)


def _described(path: Path, key: str, branch: Tree, root: Tree, matrix: Any) -> Described:
    lens, distortion = told_lens(f"{path}, {key}", branch, root, matrix)
    names = [
        str(branch[name]) for name in ("name", "camera_name", "label", "position") if isinstance(branch.get(name), str)
    ]
    topic = branch.get("rostopic")
    return Described(
        path,
        (key, *names),
        matrix,
        size=_size(path, branch),
        distortion=distortion,
        lens=lens,
        topic=topic if isinstance(topic, str) else "",
    )


def _size(path: Path, branch: Tree) -> Size | None:
    columns, rows, pair = first_of(branch, COLUMNS), first_of(branch, ROWS), first_of(branch, SIZES)
    if columns is None and rows is None and pair is None:
        return None
    width, height = sizes(path, pair if columns is None or rows is None else [columns, rows])
    return height, width


def _basalt(path: Path, branch: Tree, cameras: list[Any]) -> list[Described]:
    """Cameras in a list, their sizes in another: TUM-VIE's calibration. Their coefficients are k1 k2 k3 k4 by name."""
    all_sizes = branch.get("resolution")
    found: list[Described] = []
    for number, camera in enumerate(cameras):
        where, inner = f"{path}, camera {number}", camera.get("intrinsics") if isinstance(camera, dict) else None
        if not isinstance(inner, dict):
            raise BadFile(f"{where}: no intrinsics", fix="copy it again")
        inner = cast("Tree", inner)
        kind = str(cast("Tree", camera).get("camera_type"))
        names = ("k1", "k2", "k3", "k4") if kind == "kb4" else ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
        pair = cast("list[Any]", all_sizes)[number] if isinstance(all_sizes, list) and number < len(all_sizes) else None
        width, height = (None, None) if all_sizes is None else sizes(path, pair)
        size = None if width is None or height is None else (height, width)
        distortion = [inner[name] for name in names if name in inner] if kind != "pinhole" else []
        lens = {"kb4": "kb4", "pinhole": "none", "pinhole-radtan8": "radtan"}.get(kind, kind)
        found.append(Described(path, (f"cam{number}",), inner, size=size, distortion=distortion, lens=lens))
    return found


def _stereo(path: Path, branch: Tree) -> list[Described]:
    found: list[Described] = []
    for number in "12":
        matrix = first_of(branch, [f"{letter}{number}" for letter in STEREO])
        if isinstance(matrix, dict) and "data" in matrix:
            size, distortion = _size(path, branch), branch.get(f"D{number}", ())
            found.append(Described(path, (f"cam{int(number) - 1}",), matrix, size=size, distortion=distortion))
    return found
