"""What the branches of a calibration file say of a camera, under the names that programs give to the same numbers."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from evimo.errors import BadFile, BadInput
from evimo.geometry.calibration_numbers import numbers, pinhole, shown, sizes
from evimo.geometry.calibration_trees import Tree
from evimo.geometry.camera import COEFFICIENTS, Camera, Lens

Size = tuple[int, int]
DEEPEST = 4  # DSEC has its cameras one level down, dv-processing two
MATRICES = (
    *("camera_matrix", "intrinsics", "K", "k", "cameraMatrix", "Camera_Matrix", "CameraMatrix", "intrinsic"),
    *("intrinsic_matrix", "mtx", "projection_parameters"),
)
DISTORTIONS = (
    *("distortion_coefficients", "distortion_coeffs", "distortionCoefficients", "Distortion_Coefficients", "D", "d"),
    *("distortion", "dist_coeffs", "distCoeffs", "dist", "Distortion", "distortion_parameters"),
)
MODELS = ("distortion_model", "distortionModel", "lens_model")
SIZES = ("resolution", "image_size", "img_size", "size", "ImageSize", "imageSize")  # columns, rows
COLUMNS = ("image_width", "image_Width", "imageWidth", "width")
ROWS = ("image_height", "image_Height", "imageHeight", "height")
# Focal lengths of a sensor's longer side, to be divided and multiplied by: no lens is such.
WIDEST, NARROWEST = 20, 1000
FISHEYE_FLAGS = ("use_fisheye_model", "fisheye_model", "fisheye")
PINHOLES = ("pinhole", "Pinhole", "PINHOLE", "perspective")
STEREO = ("M", "K")  # M1 D1 M2 D2 of OpenCV's stereo sample: neither size nor names
LENSES: dict[str, Lens | None] = {
    "radtan": "radtan",
    "plumbbob": "radtan",
    "radialtangential": "radtan",
    "brownconrady": "radtan",
    "rationalpolynomial": "radtan",
    "equidistant": "fisheye",
    "equi": "fisheye",
    "fisheye": "fisheye",
    "kannalabrandt": "fisheye",
    "kannalabrandt4": "fisheye",
    "kb4": "fisheye",
    "none": None,
    "pinhole": None,
    "": None,
}


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


def lens_kind(lens: Any) -> Lens | None:
    """The lens by any of its names; None for a pinhole without one.

    Raises:
        BadInput: unknown.
    """
    name = re.sub("[-_ ]", "", lens.lower()) if isinstance(lens, str) else shown(lens)
    if name not in LENSES:
        raise BadInput(
            f"unknown lens model {shown(lens)}",
            fix="calibrate as a pinhole with radtan (plumb_bob), equidistant (fisheye) or no distortion",
        )
    return LENSES[name]


def described_cameras(path: Path, tree: Tree) -> list[Described]:
    """All cameras of a file, in its order."""
    found: list[Described] = []
    for key, branch in _branches("camera", tree, depth=0, seen=set()):
        if isinstance(cameras := branch.get("intrinsics"), list) and cameras and isinstance(cameras[0], dict):
            found += _basalt(path, branch, cast("list[Any]", cameras))
        elif (matrix := _first(branch, MATRICES)) is not None and _is_matrix(matrix):
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
    matrix = _first(branch, MATRICES)
    if depth < DEEPEST and not _is_matrix(matrix):
        for name, inner in branch.items():
            if isinstance(inner, dict) and id(cast("Tree", inner)) not in seen:
                yield from _branches(str(name), cast("Tree", inner), depth=depth + 1, seen=seen)


def _is_matrix(value: Any) -> bool:
    """Whether a value means to be a matrix: a list, OpenCV's mapping with data, or fx fy cx cy by name.

    DSEC's `intrinsics` is a mapping of cameras.
    """
    if isinstance(value, dict):
        return bool({"data", "fx", "gamma1", "mu"} & cast("Tree", value).keys())
    return isinstance(value, list | str)


def _first(branch: Tree, names: Sequence[str]) -> Any:
    return next((branch[name] for name in names if name in branch), None)


def _described(path: Path, key: str, branch: Tree, root: Tree, matrix: Any) -> Described:
    model = _first(branch, ("camera_model", "model_type")) or "pinhole"
    flags = [_first(each, FISHEYE_FLAGS) for each in (branch, root)]
    is_fisheye = any(str(flag).lower() in ("1", "true", "yes") for flag in flags)
    lens = "fisheye" if is_fisheye else _first(branch, MODELS)
    lens = lens if model in PINHOLES else model  # a fisheye by its name; another projection is said to be unknown
    distortion = _coefficients(f"{path}, {key}", branch, lens)
    if lens is None and "n_kept_views" in branch and len(numbers(f"{path}, {key}", distortion)) == 4:
        lens = "fisheye"  # Metavision does not name the lens; it gives five numbers for all others
    names = [str(branch[name]) for name in ("name", "camera_name", "position") if isinstance(branch.get(name), str)]
    topic = branch.get("rostopic")
    return Described(
        path,
        (key, *names),
        matrix,
        size=_size(path, branch),
        distortion=() if distortion is None else distortion,
        lens=lens,
        topic=topic if isinstance(topic, str) else "",
    )


def _coefficients(where: str, branch: Tree, lens: Any) -> Any:
    """The lens's coefficients: a list, or by name beside the matrix or in a branch; None where there are none.

    Raises:
        BadFile: some are there under no known name, or k1 to k4 of a lens that is not named.
    """
    value = _first(branch, DISTORTIONS)
    if value is None and (other := [name for name in branch if _may_be_distortion(name, branch[name])]):
        raise BadFile(f"{where}: its {other[0]!r} is not understood", fix="call it distortion_coefficients")
    if value is not None and (not isinstance(value, dict) or "data" in value):
        return value
    named = branch if value is None else cast("Tree", value)
    if not {"k1", "k2"} <= named.keys():
        return value
    radial = [f"k{number}" for number in range(1, 7) if f"k{number}" in named]
    if {"p1", "p2"} <= named.keys() or len(radial) != 4:
        order = ["k1", "k2", "p1", "p2", *radial[2:]]
    elif lens is None:
        raise BadFile(f"{where}: k1 k2 k3 k4 without the name of their lens", fix="say distortion_model: equidistant")
    else:
        order = radial
    return [named.get(name, 0) for name in order]


def _may_be_distortion(name: Any, value: Any) -> bool:
    known = (*DISTORTIONS, *MODELS)
    is_named_so = re.match(r"dist(?!anc|rib)", str(name), re.IGNORECASE)  # as are distances to a board
    return isinstance(value, list | dict) and bool(is_named_so) and name not in known


def _size(path: Path, branch: Tree) -> Size | None:
    columns, rows, pair = _first(branch, COLUMNS), _first(branch, ROWS), _first(branch, SIZES)
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
        width, height = sizes(path, pair)
        distortion = [inner[name] for name in names if name in inner] if kind != "pinhole" else []
        lens = {"kb4": "kb4", "pinhole": "none", "pinhole-radtan8": "radtan"}.get(kind, kind)
        found.append(Described(path, (f"cam{number}",), inner, size=(height, width), distortion=distortion, lens=lens))
    return found


def _stereo(path: Path, branch: Tree) -> list[Described]:
    found: list[Described] = []
    for number in "12":
        matrix = _first(branch, [f"{letter}{number}" for letter in STEREO])
        if isinstance(matrix, dict) and "data" in matrix:
            size, distortion = _size(path, branch), branch.get(f"D{number}", ())
            found.append(Described(path, (f"cam{int(number) - 1}",), matrix, size=size, distortion=distortion))
    return found
