"""Scenes drawn and filmed by processes beside the training, never stored."""

import os
import sys
from collections.abc import Generator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from multiprocessing.resource_tracker import ensure_running

import numba

from evimo.errors import EvimoError
from evimo.jobs.lifeline import deaf_children, hang_on
from evimo.recordings.prepared import Prepared
from evimo.training.data import Samples, samples_of
from evimo.training.film_plan import FilmPlan
from evimo.training.sources import Choices, Source


@contextmanager
def filming(plan: FilmPlan, *, workers: int) -> Generator[Source]:
    """The samples of a plan, filmed by as many processes from the first call on, for as long as the `with` lasts.

    Steps must follow each other, and places be the same at each. A worker films what its own places need, in the order
    of need, and waits when it is one recording ahead: nothing piles up, and no batch depends on who was faster.
    """
    studio = _Studio(plan, workers)
    try:
        yield studio
    finally:
        studio.close()


class _Studio:
    """The recordings that the places of a batch draw from now, and the processes that film the next ones."""

    def __init__(self, plan: FilmPlan, workers: int) -> None:
        self.plan, self.workers = plan, workers
        self.lines: dict[int, Connection] = {}  # from the worker of each place
        self.processes: list[BaseProcess] = []
        self.theirs, self.ours = get_context("spawn").Pipe(duplex=False)  # processes end when ours is closed
        self.recordings: dict[tuple[int, int], Prepared] = {}  # by place and generation
        self.samples: dict[int, tuple[range, Samples]] = {}

    def __call__(self, step: int, places: Sequence[int]) -> Sequence[Choices]:
        if not self.processes:
            self._begin(step, places)
        return [(self._samples(step, place),) for place in places]

    def close(self) -> None:
        """End the processes."""
        self.ours.close()
        self.theirs.close()
        for process in self.processes:
            process.terminate()
            process.join()

    def _begin(self, step: int, places: Sequence[int]) -> None:
        context = get_context("spawn")
        if sys.platform != "win32":
            ensure_running()  # Python's own process beside, with whose beginning all signals are heard again
        crew = min(self.workers, len(places))
        for number in range(crew):
            own = places[number::crew]
            mine, theirs = context.Pipe(duplex=False)
            process = context.Process(
                target=_film, args=(self.plan, own, step, (theirs, self.theirs), crew), daemon=True
            )
            with deaf_children():
                process.start()
            theirs.close()  # the worker then holds the only other end, and its death is noticed
            self.processes.append(process)
            self.lines |= dict.fromkeys(own, mine)

    def _samples(self, step: int, place: int) -> Samples:
        wanted = self.plan.generations(step, place)
        before, samples = self.samples.get(place, (range(0), None))
        if samples is None or before != wanted:
            while (place, wanted[-1]) not in self.recordings:
                self._receive(self.lines[place])
            samples = samples_of([self.recordings[place, generation] for generation in wanted])
            self.samples[place] = wanted, samples
            for generation in set(before) - set(wanted):
                del self.recordings[place, generation]
        return samples

    def _receive(self, line: Connection) -> None:
        """Take a worker's next recording, be it for this place or for another one."""
        try:
            place, generation, recording = line.recv()
        except EOFError as error:
            raise EvimoError("a process that films has ended", fix="see what it said above") from error
        self.recordings[place, generation] = recording


def _film(plan: FilmPlan, places: Sequence[int], step: int, lines: tuple[Connection, Connection], crew: int) -> None:
    """Film until nobody listens any more to the first line, or the other end of the second is closed."""
    line, life = lines
    hang_on(partial(_until_closed, life))
    numba.set_num_threads(max(1, numba.get_num_threads() // crew))
    if plan.device == "cuda":
        from evimo.scene.rays.on_device import cuda

        cuda.select_device(int(os.environ.get("LOCAL_RANK", "0")))
    try:
        for place, generation in plan.schedule(places, step):
            line.send((place, generation, plan.recording(place, generation)))
    except BrokenPipeError:
        return


def _until_closed(line: Connection) -> None:
    with suppress(EOFError, OSError):
        line.recv_bytes()
