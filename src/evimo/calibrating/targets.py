"""Targets that a camera and motion capture see at once, from their files: wands of lights and boards of squares."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evimo.captures.entries import Entry, load_entries
from evimo.errors import BadFile, NotFound

F8 = NDArray[np.float64]

FORM = (
    "{kind: wand, body: NAME, lights: {A: [x, y, z], ...}, markers: {A: [x, y, z], ...}}, m, or "
    "{kind: board, body: NAME, corners: [columns, rows], square: SIDE in m}"
)
ROW = re.compile(r"\s*(\S+)\s+\(([^()]*)\)\s+\(([^()]*)\)\s*")


@dataclass(frozen=True, slots=True)
class WandTarget:
    """A wand of lights.

    body:    of motion capture; "" where the file does not say.
    lights:  (K, 3), m.
    markers: (M, 3), m, on the same axes: what motion capture sees of it. None: the axes are the body's own.
    """

    body: str
    lights: F8
    markers: F8 | None


@dataclass(frozen=True, slots=True)
class BoardTarget:
    """A board of squares, by its inner corners; the first one is the origin, x along the columns.

    body:          of motion capture.
    columns, rows: of inner corners.
    square_m:      the side of a square.
    """

    body: str
    columns: int
    rows: int
    square_m: float

    @property
    def corners(self) -> F8:
        """The inner corners (columns * rows, 3), m, row by row."""
        x, y = np.meshgrid(np.arange(self.columns), np.arange(self.rows))
        return np.asarray(self.square_m * np.stack((x.ravel(), y.ravel(), np.zeros(x.size)), axis=1), np.float64)


def load_target(path: str | Path) -> WandTarget | BoardTarget:
    """The target that a file describes: YAML, or EVIMO2's table of a wand's red and infrared lights in mm.

    Raises:
        NotFound: there is no such file. BadFile: it describes no target; the message names the line.
    """
    path = Path(path)
    if not path.is_file():
        raise NotFound(f"there is no target {path}", fix=f"a file with {FORM}")
    text = path.read_text(errors="replace")
    if any(ROW.fullmatch(line) for line in text.splitlines()):
        return _evimo2_wand(path, text)
    entry = load_entries(path)
    kind = entry.named().get("kind")
    if kind is None:
        raise entry.wrong("lacks `kind`", fix=FORM)
    return _board(entry) if kind.one_of(("wand", "board")) == "board" else _wand(entry)


def _wand(entry: Entry) -> WandTarget:
    fields = entry.fields(("kind", "body", "lights"), ("markers",))
    lights = _places(fields["lights"])
    if len(lights) < 5:
        raise fields["lights"].wrong(f"are {len(lights)}", fix="five and more, on two lines that share one")
    markers = _places(fields["markers"]) if "markers" in fields else None
    return WandTarget(fields["body"].text(), lights, markers)


def _places(entry: Entry) -> F8:
    return np.array([each.numbers(3) for each in entry.named().values()]).reshape(-1, 3)


def _board(entry: Entry) -> BoardTarget:
    fields = entry.fields(("kind", "body", "corners", "square"))
    sides = fields["corners"].entries()
    if len(sides) != 2:
        raise fields["corners"].wrong("should be [columns, rows]", fix=FORM)
    columns, rows = (side.whole(3, 100) for side in sides)
    square = fields["square"].number()
    if not 0.001 <= square <= 1:
        raise fields["square"].wrong(f"is {square:g} m", fix="the side of a square in m")
    return BoardTarget(fields["body"].text(), columns, rows, square)


def _evimo2_wand(path: Path, text: str) -> WandTarget:
    """Lines `name (x y z) (x y z)`: where a light is seen by a camera, and by motion capture, mm."""
    places: list[list[list[float]]] = []
    for number, line in enumerate(text.splitlines(), 1):
        match = ROW.fullmatch(line)
        if match is None:
            if number > 1 and line.strip():
                raise BadFile(f"{path}, line {number}: {line.strip()[:60]!r} is no light", fix="NAME (x y z) (x y z)")
            continue
        try:
            pair = [[float(word) / 1e3 for word in match[at].split()] for at in (2, 3)]
        except ValueError:
            pair = []
        if [len(each) for each in pair] != [3, 3] or not np.isfinite(pair).all():
            raise BadFile(f"{path}, line {number}: {line.strip()[:60]!r} is no light", fix="NAME (x y z) (x y z)")
        places.append(pair)
    both = np.array(places)
    return WandTarget("", both[:, 0], both[:, 1])
