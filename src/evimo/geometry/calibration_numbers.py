"""Numbers in calibration files by strangers: looked at before they are used."""

import math
import reprlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

from evimo.errors import BadFile
from evimo.geometry.calibration_trees import FORMATS, Tree

TINY = 1e-6  # px: what rounding leaves of a skew that is none


def shown(value: Any) -> str:
    """The start of a value as text. Not repr: a short YAML file can nest aliases into a value whose text is endless."""
    brief = reprlib.Repr()
    brief.maxlevel = 2
    return brief.repr(value)


def is_number(value: Any) -> bool:
    """Whether it is a finite number, or the text of one."""
    try:
        return isinstance(value, str | int | float) and math.isfinite(float(value))
    except (ValueError, OverflowError):
        return False


def numbers(where: str, value: Any) -> list[float]:
    """A flat list of finite numbers: of a list, a list of rows, OpenCV's mapping with data, or fx fy cx cy by name."""
    if isinstance(value, dict):
        tree = cast("Tree", value)
        names = ("mu", "mv", "u0", "v0") if "mu" in tree else ("fx", "fy", "cx", "cy")  # camodocal's for fisheyes
        value = tree.get("data") if "data" in tree else [tree.get(name) for name in names]
    listed = list(cast("Sequence[Any]", value)) if isinstance(value, list | tuple) else [value]
    if listed and all(isinstance(row, list) for row in listed) and len(listed) < 64:
        listed = [each for row in listed for each in row[:64]]
    if not all(map(is_number, listed)):
        raise BadFile(f"{where}: not a list of finite numbers: {shown(value)}", fix=f"give {FORMATS}")
    return [float(each) for each in listed]


def sizes(path: Path, values: Any) -> tuple[int, int]:
    """Two positive whole numbers, in the file's order."""
    if isinstance(values, dict):
        values = [cast("Tree", values).get(side) for side in ("width", "height")]
    listed = cast("list[Any]", values) if isinstance(values, list) else []
    whole = [
        int(float(value)) for value in listed if is_number(value) and 1 <= float(value) == int(float(value)) < 100_000
    ]
    if len(whole) != 2 or len(listed) != 2:
        raise BadFile(f"{path}: no sensor size, or not a possible one: {shown(values)}", fix="complete the file")
    return whole[0], whole[1]


def pinhole(where: str, matrix: Sequence[float]) -> Sequence[float]:
    """(fx, fy, cx, cy), of themselves or of a 3x3 matrix given row by row."""
    if len(matrix) == 4:
        return matrix
    if len(matrix) != 9 or tuple(matrix[6:]) != (0, 0, 1) or max(abs(matrix[1]), abs(matrix[3])) > TINY:
        raise BadFile(f"{where}: not a camera matrix: {shown(matrix)}", fix="fx 0 cx 0 fy cy 0 0 1, row by row")
    return [matrix[0], matrix[4], matrix[2], matrix[5]]
