"""What is there already must have been made as what is to come: recordings are named by set and seed alone."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from evimo.errors import BadInput
from evimo.recordings.facts import facts_of


def check_made_alike(paths: Iterable[Path], wanted: dict[str, Any]) -> None:
    """Compare how finished recordings were made with what is `wanted`, by name; only their small JSON is read.

    Raises:
        BadInput: one was made otherwise. BadFile: one does not tell how it was made.
    """
    for path in paths:
        made = as_made(facts_of(path))
        other = [name for name, value in wanted.items() if made[name] != value]
        if other:
            raise BadInput(
                f"{path} is there already, made with {_words(made, other)} instead of {_words(wanted, other)}",
                fix=f"another --out than {path.parent}, or ask for {_words(made, other)} again",
            )


def as_made(facts: dict[str, Any]) -> dict[str, Any]:
    """How a recording was made, from its facts; what older versions lacked was fixed."""
    camera: dict[str, Any] = facts.get("camera", {})
    return {
        "sensor": facts.get("sensor_kind", "davis346"),
        "size": f"{camera.get('width')}x{camera.get('height')}",
        "camera": facts.get("camera_kind"),
        "seconds": facts.get("seconds"),
        "part": facts.get("part"),
        "room": facts.get("room"),
        "device": facts.get("device", "cpu"),
        "population": facts.get("population", "stress"),
        **own_content(facts),
    }


def own_content(facts: dict[str, Any]) -> dict[str, str]:
    """What textures and meshes of the user's own it has, by name; folders of the same content are the same."""
    ours = {"textures": "of the package alone", "meshes": "none"}
    told = {name: facts.get(name) for name in ours}
    return {name: f"of sha256 {fact['sha256'][:12]}" if fact else ours[name] for name, fact in told.items()}


def _words(values: dict[str, Any], names: list[str]) -> str:
    return ", ".join(f"{name} {'any' if values[name] is None else values[name]}" for name in names)
