"""From folders and a preset to a trainer that is ready to run."""

import csv
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

import torch

from evimo.errors import BadFile
from evimo.model.checkpoint import load_model
from evimo.model.motion_net import MotionNet
from evimo.model.presets import PRESETS
from evimo.recordings.prepared import EVENT_NAMES, NAMES, Prepared, open_prepared, prepare, recording_folders
from evimo.training.config import TrainConfig
from evimo.training.data import Samples, samples_of
from evimo.training.loop import Trainer


def start(
    data: list[Path],
    preset: str,
    config: TrainConfig,
    out: Path,
    *,
    device: str = "cpu",
    progress: Callable[[int, int], None],
) -> Trainer:
    """Prepare the recordings, make or load the model, go on from the folder's checkpoint if there is one.

    Args:
        data: folders of recordings.
        preset: name of a shape, or a .safetensors file to train further.
        config: of the run.
        out: folder of the run.
        device: where to train.
        progress: gets how many recordings are prepared, of how many.

    Raises:
        NotFound: no such preset or file, or a folder holds no recording.
        BadInput: no such recipe, or `out` holds a run with another configuration.
        BadFile: a recording or the checkpoint is damaged.
    """
    torch.manual_seed(config.seed)
    model = MotionNet(PRESETS[preset]).to(device) if preset in PRESETS else load_model(preset, device=device)
    trainer = Trainer(model, config, training_samples(data, progress), out)
    trainer.resume()
    return trainer


def training_samples(data: list[Path], progress: Callable[[int, int], None]) -> Samples:
    """The samples of all recordings.

    Raises:
        BadFile: no recording has a slice with truth and an event.
    """
    folders = recording_folders(data)
    _allow_open_files(len(folders) * (len(NAMES) + len(EVENT_NAMES)))
    recordings: list[Prepared] = []
    for done, folder in enumerate(folders):
        recordings.append(open_prepared(prepare(folder)))
        progress(done + 1, len(folders))
    samples = samples_of(recordings)
    if not len(samples):
        raise BadFile("no recording has a slice with truth and an event", fix="simulate recordings of at least 0.025 s")
    return samples


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


@contextmanager
def log_rows(path: Path) -> Generator[Callable[[int, dict[str, float]], None]]:
    """A function that appends a step's loss terms to a CSV file."""
    known = path.exists()
    with path.open("a", newline="") as file:
        writer = csv.writer(file)

        def row(step: int, terms: dict[str, float]) -> None:
            if not known and file.tell() == 0:
                writer.writerow(["step", *terms])
            writer.writerow([step, *(f"{value:.5g}" for value in terms.values())])
            file.flush()

        yield row
