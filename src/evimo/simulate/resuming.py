"""What is there already must have been made as what is to come: recordings are named by set and seed alone."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from evimo.errors import BadInput
from evimo.recordings.facts import facts_of
from evimo.simulate.plan import RecordingPlan, told_plan

NAMED = ("seed", "set_number")  # what the name of a recording tells


def check_made_alike(paths: Iterable[Path], plan: RecordingPlan) -> None:
    """Compare how finished recordings were made with a plan, whose seed and set are any; only their JSON is read.

    Raises:
        BadInput: one was made otherwise. BadFile: one does not tell how it was made.
    """
    height, width = plan.pixels
    wanted = _as_made(plan.facts() | {"camera": {"height": height, "width": width}})
    for path in paths:
        made = _as_made(facts_of(path))
        other = [name for name, value in wanted.items() if made[name] != value]
        if other:
            was, is_wanted = _words(made, other), _words(wanted, other)
            raise BadInput(
                f"{path} is there already, made with {was} instead of {is_wanted}",
                fix=f"another --out than {path.parent}, or ask for {was} again",
            )


def _as_made(facts: dict[str, Any]) -> dict[str, Any]:
    """How a recording was made, by name; folders of the user's own that have the same content are the same."""
    told = told_plan(facts)
    height, width = told["size"]
    ours = {"textures": "of the package alone", "meshes": "none"}
    own = {name: f"of sha256 {fact['sha256'][:12]}" if (fact := facts.get(name)) else ours[name] for name in ours}
    return {name: value for name, value in told.items() if name not in NAMED} | {"size": f"{width}x{height}", **own}


def _words(values: dict[str, Any], names: list[str]) -> str:
    return ", ".join(f"{name} {'any' if values[name] is None else values[name]}" for name in names)
