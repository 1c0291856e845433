"""Calibration files as trees of mappings, lists and words, be they YAML, JSON or XML. Nothing in them is run."""

import json
import re
from pathlib import Path
from typing import Any, cast
from xml.etree import ElementTree

import yaml

from evimo.errors import BadFile, NotFound
from evimo.geometry.stand_ins import stand_in

LARGEST_FILE = 100_000  # bytes; calibrations are a few kilobytes
FORMATS = (
    "a calibration by kalibr, ROS (camera_info), OpenCV, Metavision, DV or dv-processing, DSEC's or basalt's, "
    "or the numbers fx fy cx cy k1 k2 p1 p2 k3"
)
Tree = dict[str, Any]


class _Loader(yaml.SafeLoader):
    """YAML's safe loader, which knows OpenCV's matrices beside plain values."""


def _opencv_matrix(loader: _Loader, node: yaml.MappingNode) -> dict[Any, Any]:
    return loader.construct_mapping(node, deep=True)


_Loader.add_constructor("tag:yaml.org,2002:opencv-matrix", _opencv_matrix)


def file_text(path: Path) -> str:
    """The text of a small file.

    Raises:
        NotFound: it is not there.
        BadFile: too large, or no text.
    """
    if not path.is_file():
        raise NotFound(f"no calibration file {path}", fix="check the path")
    try:
        if (size := path.stat().st_size) > LARGEST_FILE:
            raise BadFile(f"{path}: {size} bytes are too many for a calibration", fix=f"give {FORMATS}")
        raw = path.read_bytes()
    except OSError as error:
        raise BadFile(f"{path} cannot be read: {error.strerror}", fix="check its permissions") from error
    if words := stand_in(raw):
        raise BadFile(f"{path} is {words[0]}", fix=words[1])
    encoding = "utf-16" if raw.startswith((b"\xff\xfe", b"\xfe\xff")) else "utf-8-sig"
    try:
        return raw.decode(encoding)
    except UnicodeDecodeError as error:
        raise BadFile(f"{path}: not a text file", fix=f"give {FORMATS}") from error


def beside(path: Path, name: str) -> str:
    """The text of another file in the same folder; empty where there is none."""
    other = path.with_name(name)
    return file_text(other) if other.is_file() else ""


def tree_of(path: Path, text: str) -> Tree:
    """The content of a file.

    Raises:
        BadFile: it is broken, or not a mapping.
    """
    start = text.lstrip()[:1]
    if start == "<":
        return _from_xml(path, text)
    tree = _from_json(text) if start == "{" else None
    tree = _from_yaml(path, text) if tree is None else tree
    if not isinstance(tree, dict):
        raise BadFile(f"{path}: not a calibration", fix=f"give {FORMATS}")
    return _undotted(cast("Tree", tree))


def _undotted(tree: Tree) -> Tree:
    """Keys such as Camera.fx, ORB-SLAM's, in branches; what its `Camera` says holds for Camera1 and Camera2, too."""
    branches = dict[str, Tree]()
    for key, value in tree.items():
        head, _, tail = str(key).partition(".")
        if tail:
            known = tree.get(head, {})
            branches.setdefault(head, dict(cast("Tree", known)) if isinstance(known, dict) else {})[tail] = value
    shared = branches.get("Camera", {})
    return tree | {head: shared | inner if head.startswith("Camera") else inner for head, inner in branches.items()}


def _from_json(text: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None  # a mapping of YAML may begin with the same bracket


def _from_yaml(path: Path, text: str) -> Any:
    """The first document: `rostopic echo` prints one for each message, and is often stopped within the last."""
    content = re.sub(r"\A\s*%YAML[: ]1\.\d", "", text)  # OpenCV's header is not quite YAML's
    document = next(filter(str.strip, re.split(r"^---[^\S\n]*$", content, flags=re.MULTILINE)), "")
    try:
        return yaml.load(document, Loader=_Loader)
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        problem = str(getattr(error, "problem", None) or error).splitlines()
        mark = getattr(error, "problem_mark", None)
        place = f", line {mark.line + 1}" if mark else ""
        why = problem[0] if problem else type(error).__name__
        raise BadFile(f"{path}{place}: not YAML ({why[:200]})", fix=f"give {FORMATS}") from error


def _from_xml(path: Path, text: str) -> Tree:
    if "<!" in text.replace("<!--", ""):  # a DOCTYPE or ENTITY: never in a calibration, sometimes an attack
        raise BadFile(f"{path}: XML with declarations", fix=f"give {FORMATS}")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise BadFile(f"{path}: broken XML ({error})", fix="copy or save the calibration again") from error
    tree = _branch(root, 0)
    return cast("Tree", tree) if isinstance(tree, dict) else {}


def _branch(node: ElementTree.Element, depth: int) -> Any:
    """An element as a mapping of its children; without children as its words: one, or a list."""
    if len(node) and depth < 8:
        return {child.tag: _branch(child, depth + 1) for child in node}
    words = (node.text or "").split()
    return words[0] if len(words) == 1 else words
