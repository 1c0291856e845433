"""From folders and a preset to a trainer that is ready to run."""

import os
import sys
from collections.abc import Callable, Generator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import torch

from evimo.errors import BadFile, BadInput
from evimo.jobs.crew import Crew
from evimo.model.checkpoint import load_model
from evimo.model.networks import Model, network_of
from evimo.model.presets import PRESETS
from evimo.model.widening import widened
from evimo.recordings.finding import recordings_in
from evimo.recordings.prepared import EVENT_NAMES, NAMES, Prepared, open_prepared, prepare
from evimo.simulate.film import check_device
from evimo.simulate.plan import check_population
from evimo.training.config import TrainConfig
from evimo.training.data import Samples, samples_of
from evimo.training.devices import joined_team, training_device
from evimo.training.film_plan import FilmPlan
from evimo.training.filming import filming
from evimo.training.loop import Trainer
from evimo.training.sources import Source, joined


@dataclass(frozen=True, kw_only=True)
class Workplace:
    """Where a run trains and writes; none of it changes what is learned.

    out: folder of the run. device: `cpu` or `cuda`. workers: processes that film, for each process that trains.
    threads: of the CPU that train; None is all, or the cores that workers leave: several threads that share cores
        with other processes wait for each other, and train ten times slower than one.
    """

    out: Path
    device: str = "cpu"
    workers: int = 1
    threads: int | None = None

    def __post_init__(self) -> None:
        Crew(workers=self.workers).check()
        if self.threads is not None and self.threads < 1:
            raise BadInput(f"{self.threads} threads", fix="1 or more")


@contextmanager
def started(
    data: list[Path],
    preset: str,
    config: TrainConfig,
    workplace: Workplace,
    *,
    grown_from: Path | None = None,
    progress: Callable[[int, int], None],
) -> Generator[Trainer]:
    """A trainer that is ready to run, for as long as the `with` lasts; it goes on from the folder's checkpoint.

    Args:
        data: folders of recordings; none where all is simulated.
        preset: name of a shape, or a .safetensors file to train further.
        config: of the run.
        workplace: where.
        grown_from: a .safetensors file of a smaller model; the shape starts by answering as it does.
        progress: gets how many recordings are prepared, of how many.

    Raises:
        NotFound: no such preset or file, or a folder holds no recording.
        BadInput: no such recipe, population or device, no data at all, or `out` holds a run with another configuration.
        BadFile: a recording or the checkpoint is damaged.
    """
    check_data(data, config)
    device = training_device(workplace.device)
    if workplace.threads or config.simulate:
        torch.set_num_threads(workplace.threads or max(1, (os.cpu_count() or 1) - workplace.workers))
    torch.manual_seed(config.seed)
    model = _model(preset, grown_from).to(device)
    with joined_team(device) as team, ExitStack() as films:
        if team.rank:
            team.wait()  # one process prepares, the others find it done
        samples = training_samples(data, progress) if data else None
        if not team.rank:
            team.wait()
        filmed = films.enter_context(_films(config, workplace)) if config.simulate else None
        source = joined(samples, filmed, len(config.simulate))
        told = {"recordings": samples.fingerprint() if samples else "", **_first_weights(preset, grown_from)}
        trainer = Trainer(model, config, source, workplace.out, team=team, data=told)
        trainer.resume()
        yield trainer


def _model(preset: str, grown_from: Path | None) -> Model:
    if preset not in PRESETS:
        if grown_from:
            raise BadInput(f"{preset} has weights of its own", fix=f"a shape to grow to: {', '.join(PRESETS)}")
        return load_model(preset)
    return widened(load_model(grown_from), PRESETS[preset]) if grown_from else network_of(PRESETS[preset])


def _first_weights(preset: str, grown_from: Path | None) -> dict[str, str]:
    """The digest of the file that a run begins from, if it does not begin from nothing."""
    path = grown_from or (Path(preset) if preset not in PRESETS else None)
    return {"first weights": sha256(path.read_bytes()).hexdigest()} if path else {}


def check_data(data: list[Path], config: TrainConfig) -> None:
    """Make sure that there is something to learn from.

    Raises:
        BadInput: there is nothing, or no such population.
    """
    for population in config.simulate:
        check_population(population)
    if not data and not config.simulate:
        raise BadInput("nothing to learn from", fix="folders of recordings, or --simulate replica,stress")


def _films(config: TrainConfig, workplace: Workplace) -> AbstractContextManager[Source]:
    check_device(workplace.device)
    plan = FilmPlan(
        populations=config.simulate,
        batch=config.batch,
        seed=config.seed,
        samples_per_slice=config.samples_per_slice,
        device=workplace.device,
    )
    return filming(plan, workers=workplace.workers)


def training_samples(data: list[Path], progress: Callable[[int, int], None]) -> Samples:
    """The samples of all recordings.

    Raises:
        BadFile: no recording has a slice with truth and an event.
    """
    samples = samples_of(opened(data, progress))
    if not len(samples):
        raise BadFile("no recording has a slice with truth and an event", fix="simulate recordings of at least 0.025 s")
    return samples


def opened(data: list[Path], progress: Callable[[int, int], None]) -> list[Prepared]:
    """All recordings in some folders, of any layout, prepared; `progress` gets how many are, of how many.

    Raises:
        NotFound: a folder holds none. BadFile: one is damaged.
    """
    folders = recordings_in(data) if data else []
    _allow_open_files(len(folders) * (len(NAMES) + len(EVENT_NAMES)))
    recordings: list[Prepared] = []
    for done, folder in enumerate(folders):
        recordings.append(open_prepared(prepare(folder)))
        progress(done + 1, len(folders))
    return recordings


def _allow_open_files(count: int) -> None:
    """Raise the process's limit: a memory-mapped array holds its file open, and 1024 are soon used up."""
    if sys.platform == "win32":
        return
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = count + 512
    if hard != resource.RLIM_INFINITY:
        wanted = min(wanted, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
