"""Which simulated recordings a run learns from, and when each comes and goes; no torch, as workers need none."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count

from evimo.recordings.prepared import Prepared
from evimo.scene.drawing.scenes import SETS
from evimo.simulate.plan import SLICE_S, RecordingPlan, camera_of
from evimo.simulate.prepared import filmed
from evimo.simulate.recording import simulate_recording

KEPT = 4  # recordings that a place in the batch draws from at a time
FIRST_SEED = 10**12  # far from every seed that anybody simulates to test on
SEEDS_PER_RUN = 10**8
NEXT_SEED = SEEDS_PER_RUN // 16  # beyond the recordings of any run


@dataclass(frozen=True, kw_only=True)
class FilmPlan:
    """The recordings of a run, each a function of its number; they come at fixed steps, so that every batch is fixed.

    Each place in the batch has its own recordings, so that processes that share a batch film nothing twice: number
    generation * batch + place. Populations take turns by number.

    populations: of scenes, with equal shares. batch: places. seed: of the run.
    samples_per_slice: how often a slice is the middle of a sample, on average. seconds: of each recording.
    size: (height, width), px, if not the sensor's own. device: that films them, `cpu` or `cuda`.
    """

    populations: tuple[str, ...]
    batch: int
    seed: int
    samples_per_slice: int
    seconds: float = 0.5
    size: tuple[int, int] | None = None
    device: str = "cpu"

    def generations(self, step: int, place: int) -> range:
        """Those that a place draws from at a step; places get a new one in turns, not all at once."""
        period = round(self.seconds / SLICE_S) * self.samples_per_slice
        newest = (step + place * period // self.batch) // period
        return range(max(0, newest + 1 - KEPT), newest + 1)

    def schedule(self, places: Sequence[int], step: int) -> Iterator[tuple[int, int]]:
        """Place and generation of all recordings that these places need from a step on, in the order of need."""
        for place in places:
            yield from ((place, generation) for generation in self.generations(step, place))
        for later in count(step + 1):
            for place in places:
                newest = self.generations(later, place)[-1]
                if newest > self.generations(later - 1, place)[-1]:
                    yield place, newest

    def recording(self, place: int, generation: int) -> Prepared:
        """Draw and film one; of a scene without any event, another seed's."""
        number = generation * self.batch + place
        population = self.populations[number % len(self.populations)]
        set_number = list(SETS)[number // len(self.populations) % len(SETS)]
        seed = FIRST_SEED + self.seed * SEEDS_PER_RUN + number
        found = self._filmed(seed, population, set_number)
        while not len(found.event_t):
            seed += NEXT_SEED
            found = self._filmed(seed, population, set_number)
        return found

    def _filmed(self, seed: int, population: str, set_number: int) -> Prepared:
        plan = RecordingPlan(
            seed=seed,
            set_number=set_number,
            seconds=self.seconds,
            camera=camera_of(population),
            size=self.size,
            part="train",
            device=self.device,
            population=population,
        )
        return filmed(simulate_recording(plan))
