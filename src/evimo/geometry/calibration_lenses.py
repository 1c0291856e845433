"""The lens of a camera in calibration files: the names that programs give to its model and its coefficients."""

import re
from collections.abc import Mapping, Sequence
from typing import Any, cast

from evimo.errors import BadFile, BadInput
from evimo.geometry.calibration_numbers import numbers, shown
from evimo.geometry.calibration_trees import Tree
from evimo.geometry.camera import Lens

DISTORTIONS = (
    *("distortion_coefficients", "distortion_coeffs", "distortionCoefficients", "Distortion_Coefficients", "D", "d"),
    *("distortion", "dist_coeffs", "distCoeffs", "dist", "Distortion", "distortion_parameters"),
)
MODELS = ("distortion_model", "distortionModel", "lens_model")
CAMERA_MODELS = ("camera_model", "model_type")
MAYBE_MODELS = ("type", "model", "camera_type", "projection_model")  # where what they say is a lens
OTHER_LENSES = {"omni", "omnidirectional", "mei", "ds", "doublesphere", "eucm", "fov", "atan", "ocam", "scaramuzza"}
FISHEYE_FLAGS = ("use_fisheye_model", "fisheye_model", "fisheye")
PINHOLES = ("pinhole", "perspective")
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
    "kannalabrandt8": "fisheye",
    "kb4": "fisheye",
    "none": None,
    "pinhole": None,
    "": None,
}


def first_of(branch: Mapping[str, Any], names: Sequence[str]) -> Any:
    """The value of the first of these names that is there; None where none is."""
    return next((branch[name] for name in names if name in branch), None)


def lens_kind(lens: Any) -> Lens | None:
    """The lens by any of its names; None for a pinhole without one.

    Raises:
        BadInput: unknown.
    """
    name = _plain(lens) if isinstance(lens, str) else shown(lens)
    if name not in LENSES:
        raise BadInput(
            f"unknown lens model {shown(lens)}",
            fix="calibrate as a pinhole with radtan (plumb_bob), equidistant (fisheye) or no distortion",
        )
    return LENSES[name]


def _plain(lens: str) -> str:
    return re.sub("[-_ ]", "", lens.lower())


def told_lens(where: str, branch: Tree, root: Tree, matrix: Any) -> tuple[Any, Any]:
    """The lens by its name in a branch, None where it has none, and its coefficients, () where there are none.

    Raises:
        BadFile: as `_coefficients`.
    """
    flags = [first_of(each, FISHEYE_FLAGS) for each in (branch, root)]
    is_fisheye = any(str(flag).lower() in ("1", "true", "yes") for flag in flags)
    lens = "fisheye" if is_fisheye else first_of(branch, MODELS)
    value = first_of(branch, DISTORTIONS)
    if isinstance(value, dict) and "parameters" in value:  # as RPG's SVO has it, beside the name of the model
        inner = cast("Tree", value)
        value, lens = inner["parameters"], inner.get("type", lens)
    model = _model(branch)
    lens = lens if model in (None, *PINHOLES) else model  # a fisheye by its name; another is said to be unknown
    distortion = _coefficients(where, branch, value, lens=lens, matrix=matrix)
    if lens is None and "n_kept_views" in branch and len(numbers(where, distortion)) == 4:
        lens = "fisheye"  # Metavision does not name the lens; it gives five numbers for all others
    return lens, () if distortion is None else distortion


def _model(branch: Tree) -> Any:
    """The model of a branch's camera, a pinhole's in small letters; None where it tells none.

    Where the lens has a name of its own, a type or the like does not name another that is known.
    """
    model = first_of(branch, CAMERA_MODELS)
    if model is None:
        lenses = {name for name, kind in LENSES.items() if kind and first_of(branch, MODELS) is None}
        words = [branch[name] for name in MAYBE_MODELS if isinstance(branch.get(name), str)]
        model = next((word for word in words if _plain(word) in lenses | OTHER_LENSES | set(PINHOLES)), None)
    return _plain(model) if isinstance(model, str) and _plain(model) in PINHOLES else model


def _coefficients(where: str, branch: Tree, value: Any, *, lens: Any, matrix: Any) -> Any:
    """The lens's coefficients: a list, or by name in a branch of theirs, beside the matrix or within it; None without.

    Raises:
        BadFile: some are there under no known name, or k1 to k4 of a lens that is not named.
    """
    if value is None and (other := [name for name in branch if _may_be_distortion(name, branch[name])]):
        raise BadFile(f"{where}: its {other[0]!r} is not understood", fix="call it distortion_coefficients")
    if value is not None and (not isinstance(value, dict) or "data" in value):
        return value
    for named in (value, branch, matrix):
        if isinstance(named, dict) and (order := _order(where, cast("Tree", named), lens)):
            return [cast("Tree", named).get(name, 0) for name in order]
    return value


def _order(where: str, named: Tree, lens: Any) -> list[str]:
    """The coefficients that a branch names, in OpenCV's order; none where it names none.

    Raises:
        BadFile: k1 to k4 of a lens that is not named.
    """
    if "k1" not in named and {"k2", "k3", "k4", "k5"} <= named.keys():  # camodocal's, whose k1 is 1
        return ["k2", "k3", "k4", "k5"]
    if not {"k1", "k2"} <= named.keys():
        return []
    radial = [f"k{number}" for number in range(1, 7) if f"k{number}" in named]
    if {"p1", "p2"} <= named.keys() or len(radial) != 4:
        return ["k1", "k2", "p1", "p2", *radial[2:]]
    if lens is None:
        raise BadFile(f"{where}: k1 k2 k3 k4 without the name of their lens", fix="say distortion_model: equidistant")
    return radial


def _may_be_distortion(name: Any, value: Any) -> bool:
    known = (*DISTORTIONS, *MODELS)
    is_named_so = re.match(r"dist(?!anc|rib)", str(name), re.IGNORECASE)  # as are distances to a board
    return isinstance(value, list | dict) and bool(is_named_so) and name not in known
