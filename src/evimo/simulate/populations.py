"""The populations of scenes: `stress`, as hard as scenes may be, `replica`, as in EV-IMO, and `planar`, a wall."""

from typing import Any

import numpy as np

from evimo.scene.bodies import Scene
from evimo.scene.drawing.planar import draw_planar_scene
from evimo.scene.drawing.pools import POOLS
from evimo.scene.drawing.replica import MAPS, NO_MOVERS, draw_replica_scene
from evimo.scene.drawing.scenes import draw_scene
from evimo.scene.drawing.toys import is_seen
from evimo.scene.textures.bank import TextureBank, texture_bank
from evimo.simulate.plan import RecordingPlan

BACKGROUNDS = {"boxes": "box", "floor": "floor", "wall": "wall", "table": "table", "tabletop": "tabletop"}
LONG_S = 2.0  # from here on a replica's scene has movers in any case


def bank_of(plan: RecordingPlan, seed: int) -> TextureBank:
    """Textures of one seed, for the scenes of a plan's population."""
    maps = MAPS if plan.population == "replica" else 0
    if plan.part:
        return POOLS[plan.part].bank(seed, images=plan.own.textures, maps=maps)
    return texture_bank(seed, images=plan.own.textures, maps=maps)


def drawn_scene(plan: RecordingPlan, rng: np.random.Generator, bank: TextureBank) -> Scene:
    """One scene; none lacks movers where a plan is held to a room, as a replica of all of EV-IMO is."""
    style, part = plan.style, plan.part
    if plan.population == "planar":
        return draw_planar_scene(rng, style, bank, seconds=plan.seconds)
    meshes = plan.own.mesh_bank()
    if plan.population == "stress":
        pool = POOLS[part] if part else None
        return draw_scene(rng, style, bank, seconds=plan.seconds, pool=pool, meshes=meshes)
    empty = NO_MOVERS if plan.seconds < LONG_S and part != "test" and plan.room is None else 0.0
    return draw_replica_scene(rng, style, bank, seconds=plan.seconds, part=part, empty=empty, meshes=meshes)


def population_facts(plan: RecordingPlan, scene: Scene) -> dict[str, Any]:
    """What a recording tells of its scene beside its plan: nothing of `stress`, as recordings never did.

    background: of the scene. objects, objects_seen: by id, the kind of toy, and whether it is in training, too.
    """
    if plan.population == "stress":
        return {}
    kinds = {str(number): body.kind for number, body in enumerate(scene.movers, 1)}
    return {
        "background": _background(plan, scene),
        "objects": kinds,
        "objects_seen": {number: is_seen(kind, plan.part) for number, kind in kinds.items()},
    }


def _background(plan: RecordingPlan, scene: Scene) -> str:
    """What the recording's scores are grouped by; those in the dark are named after their motion."""
    if plan.population == "planar":
        return "planar"
    return "fast" if plan.style.dark else BACKGROUNDS[scene.room]
