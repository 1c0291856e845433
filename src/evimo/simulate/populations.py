"""The two populations of scenes: `stress`, as hard as scenes may be, and `replica`, as EV-IMO's pictures show them."""

from typing import Any

import numpy as np

from evimo.errors import BadInput
from evimo.scene.bodies import Scene
from evimo.scene.drawing.pools import POOLS
from evimo.scene.drawing.replica import MAPS, NO_MOVERS, draw_replica_scene
from evimo.scene.drawing.scenes import SetStyle, draw_scene
from evimo.scene.drawing.toys import is_seen
from evimo.scene.textures.bank import TextureBank, texture_bank
from evimo.simulate.own_folders import OwnFolders

POPULATIONS = ("stress", "replica")
BACKGROUNDS = {"boxes": "box", "floor": "floor", "wall": "wall", "table": "table", "tabletop": "tabletop"}
LONG_S = 2.0  # from here on a replica's scene has movers in any case


def check_population(population: str) -> None:
    """Refuse what is no population.

    Raises:
        BadInput: it is none.
    """
    if population not in POPULATIONS:
        raise BadInput(f"no population {population!r}", fix=f"one of {', '.join(POPULATIONS)}")


def bank_of(population: str, seed: int, part: str | None, own: OwnFolders) -> TextureBank:
    """Textures of one seed, for the scenes of a population."""
    maps = MAPS if population == "replica" else 0
    if part:
        return POOLS[part].bank(seed, images=own.textures, maps=maps)
    return texture_bank(seed, images=own.textures, maps=maps)


def drawn_scene(
    population: str,
    rng: np.random.Generator,
    style: SetStyle,
    bank: TextureBank,
    *,
    seconds: float,
    part: str | None,
    whole: bool,
    own: OwnFolders,
) -> Scene:
    """One scene. whole: of a replica of all of EV-IMO, where no scene lacks movers."""
    meshes = own.mesh_bank()
    if population == "stress":
        return draw_scene(rng, style, bank, seconds=seconds, pool=POOLS[part] if part else None, meshes=meshes)
    empty = NO_MOVERS if seconds < LONG_S and part != "test" and not whole else 0.0
    return draw_replica_scene(rng, style, bank, seconds=seconds, part=part, empty=empty, meshes=meshes)


def population_facts(population: str, scene: Scene, style: SetStyle, part: str | None) -> dict[str, Any]:
    """What a recording tells of its population: nothing of `stress`, as recordings never did.

    background: of the scene. objects, objects_seen: by id, the kind of toy, and whether it is in training, too.
    """
    if population == "stress":
        return {}
    kinds = {str(number): body.kind for number, body in enumerate(scene.movers, 1)}
    return {
        "population": population,
        "background": "fast" if style.dark else BACKGROUNDS[scene.room],
        "objects": kinds,
        "objects_seen": {number: is_seen(kind, part) for number, kind in kinds.items()},
    }
