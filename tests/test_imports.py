"""Data flows one way, `import evimo` costs nothing, and running a model never asks for what only training needs."""

import ast
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Iterator
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

SRC = Path(__file__).parents[1] / "src" / "evimo"

# A room imports only from rows above its own in this list, never from its own row (docs/decisions/0001).
ROWS = [
    "errors locks",
    "arguments",
    "compiling geometry samples writing",
    "events jobs",
    "formats",
    "recordings",
    "scene model losses classical predictions",
    "captures",
    "annotate calibrating simulate evaluation viewing",
    "training streaming",
    "benchmark",
    "cli",
]
HEIGHT = {room: height for height, row in enumerate(ROWS) for room in row.split()}

# These come with an extra: imported only inside the function that needs them, except in rooms that nobody enters
# without the extra.
SIMULATING = ["scipy", "skimage", "trimesh", "small_gicp"]
EXTRAS = [
    *(*SIMULATING, "torch", "safetensors", "jaxtyping", "onnx", "onnxscript", "hdf5plugin", "rerun", "distributed"),
    *("matplotlib", "jinja2"),
]
ROOMS_OF_EXTRAS = {"model", "losses", "training", "scene", "captures", "annotate", "calibrating", "simulate"}
TRAINING_MODULES = {f"evimo.geometry.{name}" for name in ("grids", "motion_field", "poses", "warping")}


def imported(file: Path) -> Iterator[str]:
    """Every name the file imports, as `package.module.name`; relative imports are banned by the linter."""
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import | ast.ImportFrom):
            prefix = f"{node.module}." if isinstance(node, ast.ImportFrom) else ""
            yield from (prefix + alias.name for alias in node.names)


def home(file: Path) -> str:
    """The room of a file, or its own name where it stands in none, as `errors` and `writing` do."""
    return file.relative_to(SRC).with_suffix("").parts[0]


def rooms_of(file: Path) -> set[str]:
    """The other rooms that a file imports from."""
    return {name.split(".")[1] for name in imported(file) if name.startswith("evimo.")} - {home(file)}


FILES = [file for file in sorted(SRC.rglob("*.py")) if home(file) in HEIGHT]


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(SRC)))
def test_rooms_import_only_from_below(file: Path):
    assert {other for other in rooms_of(file) if HEIGHT[other] >= HEIGHT[home(file)]} == set()


def arrows() -> dict[str, set[str]]:
    """Each room, and the rooms that its files import from."""
    return {room: set().union(*(rooms_of(file) for file in FILES if home(file) == room)) for room in map(home, FILES)}


def in_circles(graph: dict[str, set[str]]) -> set[str]:
    """What lies on a circle of arrows, or between two."""
    left = set(graph)
    while ends := {one for one in left if not graph[one] & left or not any(one in graph[other] for other in left)}:
        left -= ends
    return left


def test_no_circle_joins_rooms():
    assert in_circles({"a": {"b"}, "b": {"c"}, "c": {"b", "d"}, "d": set()}) == {"b", "c"}
    assert in_circles(arrows()) == set()


def test_every_room_has_a_row():
    rooms = {folder.name for folder in SRC.iterdir() if (folder / "__init__.py").exists()}
    assert rooms - HEIGHT.keys() == set()


def test_importing_evimo_imports_nothing_heavy():
    heavy = ["numpy", "numba", "cv2", "onnxruntime", "h5py", "av", "lz4", "rosbags", *EXTRAS]
    loaded = printed_by(f"import sys, evimo; print(*[name for name in {heavy} if name in sys.modules])")
    assert loaded.split() == []


def test_base_rooms_import_without_any_extra():
    """Every module that running needs is imported in an interpreter that has none of the extras."""
    modules = [name for name in all_modules() if name not in TRAINING_MODULES and room_of(name) not in ROOMS_OF_EXTRAS]
    program = f"""
import importlib, sys
for extra in {EXTRAS}:
    sys.modules[extra] = None  # an import of it raises ImportError
for name in {modules}:
    try:
        importlib.import_module(name)
    except ImportError as error:
        print(name, "needs", error.name)
"""
    assert printed_by(program) == ""


def test_what_is_imported_is_declared_and_the_other_way_round():
    """Nothing arrives by way of another package's dependencies, and users install nothing that is not used."""
    project = tomllib.loads((SRC.parents[1] / "pyproject.toml").read_text())["project"]
    base, extras = project["dependencies"], project["optional-dependencies"]
    homes = packages_distributions()
    names = {name.split(".")[0] for file in SRC.rglob("*.py") for name in imported(file)}
    used = spelled(home for name in names - {"evimo"} for home in homes.get(name, []))
    installed = spelled(home for found in homes.values() for home in found)  # some are for other Python versions
    wanted = ("train", "formats", "view", "simulate", "cluster", "benchmark")
    assert used - spelled([*base, *(each for extra in wanted for each in extras[extra])]) == set()
    assert (spelled(base) & installed) - used == set()


def spelled(requirements: Iterable[str]) -> set[str]:
    """Names of distributions in one spelling, without versions and markers."""
    names = (re.split(r"[^\w.-]", requirement, maxsplit=1)[0] for requirement in requirements)
    return {re.sub(r"[-_.]+", "-", name).lower() for name in names}


def all_modules() -> list[str]:
    """Dotted names of every module of the package."""
    files = (file.relative_to(SRC.parent).with_suffix("") for file in sorted(SRC.rglob("*.py")))
    return [".".join(file.parts).removesuffix(".__init__") for file in files if file.name != "__main__"]


def room_of(module: str) -> str:
    """`evimo.formats` is in the room `events`; `evimo` itself is in none."""
    return f"{module}.".split(".")[1]


def printed_by(program: str) -> str:
    """What a fresh interpreter prints."""
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout


if __name__ == "__main__":  # python tests/test_imports.py: the arrows between rooms, the highest room first
    found = arrows()
    for room in sorted(found, key=lambda room: (-HEIGHT[room], room)):
        print(f"{room:<11}-> {' '.join(sorted(found[room], key=lambda other: (-HEIGHT[other], other)))}")
    print(f"{len(found)} rooms, {sum(map(len, found.values()))} arrows, in circles: {len(in_circles(found))}")
