"""The backgrounds that the paper's tables are made of, and which of them a recording shows."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evimo.evaluation.kinds import groups_of

PLANAR = "planar"
BACKGROUND = "background "
"""How the group of a recording's background begins."""


@dataclass(frozen=True, slots=True)
class SceneKind:
    """One background. title: as our tables say it. paper: as the paper's do."""

    name: str
    title: str
    paper: str


SCENES = {
    scene.name: scene
    for scene in (
        SceneKind("table", "table", "table"),
        SceneKind("wall", "plain wall", "plain wall"),
        SceneKind("fast", "fast motion", "fast motion"),
        SceneKind("box", "boxes", "cube background"),
        SceneKind(PLANAR, "plain wall alone, no objects, no roll or pitch", "plain wall"),
    )
}
ALL, ELSE = "all recordings", "other recordings"
"""Blocks of tables: of recordings without a background of the paper's, alone and beside such."""
OTHER = "other"
"""The background of a recording that has none of these."""


def background_of(path: Path, meta: Mapping[str, Any], *, below: Path) -> str:
    """The background of a recording: as it says itself, or the folder of a release of EV-IMO that it lies in."""
    for group in groups_of(meta):
        if group.startswith(BACKGROUND) and (name := group.removeprefix(BACKGROUND)) in SCENES:
            return name
    folders = path.relative_to(below).parts[:-1] if path.is_relative_to(below) else ()
    return next((folder for folder in reversed(folders) if folder in SCENES), OTHER)
