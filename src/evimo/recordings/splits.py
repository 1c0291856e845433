"""Published divisions of EV-IMO and EVIMO2 into training and test, as data, and where in a dataset a recording lies."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal

from evimo.errors import BadInput, NotFound

Part = Literal["train", "test"]

FOLDERS = {"train": "train", "eval": "eval", "test": "eval"}  # the replica of `evimo simulate` says `test`
BACKGROUNDS = ("box", "floor", "wall", "table", "tabletop", "fast", "tabletop-egomotion", "basic")
CATEGORIES = ("imo", "imo_ll", "sfm", "sfm_ll", "sanity", "sanity_ll")
CAMERAS = ("flea3_7", "left_camera", "right_camera", "samsung_mono")


@dataclass(frozen=True, slots=True)
class Place:
    """What the folders above a recording say of it; empty where they say nothing.

    folder: `train` or `eval` as the download has it. group: background of EV-IMO, or category of EVIMO2.
    """

    sequence: str
    folder: str = ""
    group: str = ""
    camera: str = ""

    def facts(self) -> dict[str, str]:
        """What is known, for the recording's `meta`."""
        known = {"sequence": self.sequence, "set": "EVIMO2" if self.group in CATEGORIES else "EV-IMO"}
        known |= {"background": self.group} if self.group else {}
        known |= {"folder": self.folder} if self.folder else {}
        return known | ({"sensor": self.camera} if self.camera else {})


def place_of(path: Path) -> Place:
    """Where a recording lies: `train/box/npz/seq_01.npz`, or `left_camera/imo/eval/scene13_dyn_test_00_000000`."""
    path = path.resolve()
    sequence = path.stem if path.is_file() else path.name
    parts = path.parts[:-1]
    for at in range(len(parts) - 1, 0, -1):
        before, here = parts[at - 1], parts[at]
        if before in FOLDERS and here in BACKGROUNDS:
            return Place(sequence, FOLDERS[before], here)
        if before in CATEGORIES:
            camera = parts[at - 2] if at > 1 and parts[at - 2] in CAMERAS else ""
            return Place(sequence, FOLDERS.get(here, ""), before, camera)
    return Place(sequence)


@cache
def splits() -> dict[str, dict[str, list[str]]]:
    """Every split by name: of each part the folders `train/box`, or the names of sequences."""
    return json.loads(Path(__file__).with_name("splits.json").read_text())


def part_of_split(paths: Sequence[Path], split: str, part: Part) -> list[Path]:
    """The recordings that belong to one part of a split, in their order.

    Raises:
        BadInput: no such split. NotFound: none belongs to it.
    """
    if split not in splits():
        raise BadInput(f"no split {split!r}", fix=f"one of: {', '.join(splits())}")
    wanted = set(splits()[split][part])
    kept = [path for path in paths if wanted & _names(place_of(path))]
    if not kept:
        listed = ", ".join(sorted(wanted)[:4]) or "nothing"
        raise NotFound(f"none of {len(paths)} recordings is in the {part} part of {split}", fix=f"it holds {listed}…")
    return kept


def _names(place: Place) -> set[str]:
    return {place.sequence, f"{place.folder}/{place.group}"}
