"""What one simulated recording is made from, and the same read back from what a recording tells of itself."""

from dataclasses import dataclass, replace
from typing import Any

from evimo.errors import BadInput
from evimo.events.slices import SLICE_US
from evimo.recordings.facts import own_version
from evimo.scene.drawing.pools import POOLS
from evimo.scene.drawing.scenes import SETS, SetStyle
from evimo.simulate.own_folders import OWN, OwnFolders
from evimo.simulate.sensor import known_sensor

SLICE_S = SLICE_US * 1e-6
SMALLEST_PX = 16  # of either side
CAMERAS = {"stress": "random", "replica": "evimo", "planar": "evimo"}
"""Each population of scenes, and the camera that films it where nothing else is asked for."""


@dataclass(frozen=True, kw_only=True)
class RecordingPlan:
    """All that one recording is made from: the same plan gives the same recording.

    seed: from 0. set_number: of the paper's sets, 1 to 6. seconds: a multiple of 0.025.
    camera: `random` or `evimo`. sensor: one of `sensor.SENSORS`.
    size: (height, width) in px, if not the sensor's own.
    part: `train` or `test` draws textures and shapes that the other, and a recording without, never have.
    room: one of the set's. own: folders of pictures for textures, and of meshes.
    device: that films it, `cpu` or `cuda`: the same scene, but not quite the same events, as a GPU casts every tile in
        every frame.
    population: `stress`, or `replica`: as EV-IMO's pictures show it, where 8 % of short scenes lack movers, unless they
        are held to a room or for testing; or `planar`: one wall and nothing that moves, before a camera that neither
        rolls nor pitches, at the pace and in the light of its set.

    Raises:
        BadInput: no such seed, set, sensor, size, part, room or population, or no whole number of slices.
    """

    seed: int
    set_number: int = 1
    seconds: float = 1.0
    camera: str = "random"
    sensor: str = "davis346"
    size: tuple[int, int] | None = None
    part: str | None = None
    room: str | None = None
    own: OwnFolders = OWN
    device: str = "cpu"
    population: str = "stress"

    def __post_init__(self) -> None:
        check_population(self.population)
        known_sensor(self.sensor)
        height, width = self.pixels
        if self.set_number not in SETS:
            raise BadInput(f"no set {self.set_number}", fix="a set from 1 to 6")
        slices = self.seconds / SLICE_S
        if not 1 <= slices < float("inf") or abs(slices - round(slices)) > 1e-6:
            raise BadInput(f"recordings of {self.seconds} s", fix=f"a multiple of {SLICE_S:g} s, the length of a slice")
        if min(height, width) < SMALLEST_PX:
            raise BadInput(f"recordings of {width}x{height} px", fix=f"at least {SMALLEST_PX}x{SMALLEST_PX} px")
        if self.seed < 0:
            raise BadInput(f"seed {self.seed}", fix="a seed from 0")
        if self.part is not None and self.part not in POOLS:
            raise BadInput(f"no part {self.part!r}", fix=f"one of {', '.join(POOLS)}")
        if self.room is not None and self.room not in SETS[self.set_number].rooms:
            rooms = ", ".join(SETS[self.set_number].rooms)
            raise BadInput(f"no room {self.room!r} in set {self.set_number}", fix=f"one of {rooms}")

    @property
    def pixels(self) -> tuple[int, int]:
        """Height and width of the recording, px."""
        return self.size or known_sensor(self.sensor).size

    @property
    def slices(self) -> int:
        """How many slices it has."""
        return round(self.seconds / SLICE_S)

    @property
    def style(self) -> SetStyle:
        """The style of its set, in one of its rooms if that is asked for."""
        style = SETS[self.set_number]
        return style if self.room is None else replace(style, rooms=(self.room,))

    def facts(self) -> dict[str, Any]:
        """The plan as the recording's JSON tells it; the camera's lens, which the writer adds, tells the size."""
        held = {"part": self.part, "room": self.room} if self.part or self.room else {}
        population = {} if self.population == "stress" else {"population": self.population}
        return {
            "version": own_version(),
            "camera_kind": self.camera,
            "set": self.set_number,
            "seed": self.seed,
            "seconds": self.seconds,
            "sensor_kind": self.sensor,
            "device": self.device,
            **held,
            **population,
            **self.own.facts(),
        }


def camera_of(population: str) -> str:
    """The camera that films a population where no other is asked for.

    Raises:
        BadInput: no such population.
    """
    check_population(population)
    return CAMERAS[population]


def check_population(population: str) -> None:
    """Refuse what is no population.

    Raises:
        BadInput: it is none.
    """
    if population not in CAMERAS:
        raise BadInput(f"no population {population!r}", fix=f"one of {', '.join(CAMERAS)}")


def told_plan(facts: dict[str, Any]) -> dict[str, Any]:
    """The plan that a recording's facts tell of, by the names of `RecordingPlan`, but for the user's own folders.

    What older versions did not tell was fixed. What is missing else is None.
    """
    lens: dict[str, Any] = facts.get("camera", {})
    return {
        "seed": facts.get("seed"),
        "set_number": facts.get("set"),
        "seconds": facts.get("seconds"),
        "camera": facts.get("camera_kind"),
        "sensor": facts.get("sensor_kind", "davis346"),
        "size": (lens.get("height"), lens.get("width")),
        "part": facts.get("part"),
        "room": facts.get("room"),
        "device": facts.get("device", "cpu"),
        "population": facts.get("population", "stress"),
    }
