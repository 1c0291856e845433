"""`evimo train`: train a model on recordings, or on scenes that are simulated meanwhile."""

import os
import warnings
from collections.abc import Callable, Generator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from evimo.cli.progress import Advance, progress
from evimo.errors import BadInput, EvimoWarning, check_installed
from evimo.recordings.finding import recordings_in
from evimo.writing import make_folder

if TYPE_CHECKING:
    from evimo.training.config import TrainConfig
    from evimo.training.loop import Trainer
    from evimo.training.start import Workplace

Report = Callable[[int, dict[str, float]], None]


def train(
    *data: Path,
    simulate: str = "",
    validate: Annotated[tuple[Path, ...], Parameter(consume_multiple=True)] = (),
    validate_every: int = 500,
    split: str = "",
    preset: str = "small",
    grow: Path | None = None,
    out: Path,
    recipe: str = "shipped",
    steps: int = 4000,
    batch: int = 8,
    learning_rate: float = 2e-3,
    seed: int = 0,
    samples_per_slice: int = 4,
    device: Literal["cpu", "cuda"] = "cpu",
    workers: int | None = None,
    threads: int | None = None,
) -> None:
    """Train on simulated recordings; the same command again goes on where it stopped.

    Leaves `model.safetensors` (averaged weights with their configuration), `model.onnx` with `model.first.onnx` (to
    run; ecn, which looks once, has the former alone), `log.csv`, `validation.csv` and curves for TensorBoard in the
    output folder. Each recording is brought into its rectified image once, in a folder inside it. Several processes,
    each with its share of every batch, on one machine or several that see the same folders: `torchrun
    --nproc-per-node N -m evimo train ...`.

    Args:
        data: recordings with truth, or folders that hold them: EV-IMO and EVIMO2 in any of their layouts, and what
            `evimo simulate` or `evimo convert` makes.
        simulate: populations of scenes, `replica,stress` or one of them, with equal shares; they are drawn and filmed
            while the model learns, and never stored. Recordings in folders are then one more population.
        validate: folders of recordings to score the model on now and then; best none that it learns from.
        validate_every: steps between scores.
        split: only recordings of the training part of a published split, such as `paper2019` or `evimo2-imo`.
        preset: a shape to start afresh, `base`, `small`, `tiny` or `ecn`, or a .safetensors file to train further.
        grow: a .safetensors file of a smaller model, such as small's for base: the shape starts with its answers.
        out: folder of the run.
        recipe: `shipped` (supervised by the simulator) or `paper` (its losses only); `ecn` (by warping alone) for ecn.
        steps: batches.
        batch: samples per batch, over all processes.
        learning_rate: highest; a half cosine follows.
        seed: of the first weights and of the batches.
        samples_per_slice: how often a filmed slice is learned from, on average; fewer wait longer for scenes.
        device: `cpu` or `cuda`, which trains and films.
        workers: processes that film, for each process that trains; by default the cores but one.
        threads: of the CPU that train; by default all, or as many as workers leave.
    """
    from evimo.training.config import TrainConfig

    if validate_every < 1:
        raise BadInput(f"a score every {validate_every} steps", fix="--validate-every 500")
    config = TrainConfig(
        recipe=recipe,
        steps=steps,
        batch=batch,
        learning_rate=learning_rate,
        seed=seed,
        simulate=tuple(name.strip() for name in simulate.split(",") if name.strip()),
        samples_per_slice=samples_per_slice,
    )
    check_installed("training", "torch", "tensorboard", "scipy", "skimage", extra="train")
    from evimo.training.start import Workplace

    workers = max(1, (os.cpu_count() or 2) - 1) if workers is None else workers
    workplace = Workplace(out=out, device=device, workers=workers, threads=threads)
    recordings = recordings_in(data, split=split, part="train") if data else []
    _warn_of_recordings_in_both(recordings, recordings_in(validate) if validate else [])
    _train(recordings, (preset, grow), config, workplace, validation=(list(validate), validate_every))


def _warn_of_recordings_in_both(learned: list[Path], validated: list[Path]) -> None:
    """Say that scores mean little where a recording is learned from, too."""
    known = {path.resolve() for path in learned}
    both = [path for path in validated if path.resolve() in known]
    if both and os.environ.get("RANK", "0") == "0":  # of several processes one says it
        problem = (
            f"{both[0]} is learned from and validated on: scores say nothing of new recordings"
            f" ({len(both)} of {len(validated)} to validate on)"
        )
        warnings.warn(EvimoWarning(problem), stacklevel=2)


def _train(
    data: list[Path],
    start: tuple[str, Path | None],
    config: "TrainConfig",
    workplace: "Workplace",
    *,
    validation: tuple[list[Path], int],
) -> None:
    """Prepare, train and export, and show how far each is."""
    from evimo.model.export import export
    from evimo.training.start import started

    silent = os.environ.get("RANK", "0") != "0"  # of several processes one talks
    with (
        _preparing(silent) as prepared,
        started(data, start[0], config, workplace, grown_from=start[1], progress=prepared) as trainer,
        progress(config.steps, "steps", silent=silent) as advance,
    ):
        advance(trainer.step, made=False)

        def show(step: int, terms: dict[str, float]) -> None:
            pace = trainer.pace
            advance(facts=f"loss {terms['loss']:.3f}, {pace.samples_per_s:.1f} samples/s, {pace.waited:.0%} waiting")

        with _noted(trainer, *validation, show) as report:
            trainer.run(report)
    if not trainer.team.rank:
        export(trainer.averaged(), workplace.out / "model.onnx")
        made = (
            name for name in ("model.safetensors", "model.onnx", "model.first.onnx") if (workplace.out / name).exists()
        )
        print(f"saved in {workplace.out}: {', '.join(made)}")


@contextmanager
def _preparing(silent: bool) -> Generator[Callable[[int, int], None]]:
    """Shows how many recordings are prepared, of how many, from the first to the last of them."""
    with ExitStack() as bar:
        shown: list[Advance] = []

        def prepared(done: int, total: int) -> None:
            if not shown:
                shown.append(bar.enter_context(progress(total, "recordings prepared", silent=silent)))
            shown[0]()
            if done == total:
                bar.close()

        yield prepared


@contextmanager
def _noted(trainer: "Trainer", validate: list[Path], every: int, show: Report) -> Generator[Report]:
    """What one process of a team does after each step: curves, scores now and then, the bar."""
    if trainer.team.rank:
        yield lambda step, terms: None
        return
    from evimo.training.curves import open_curves
    from evimo.training.start import opened

    recordings = opened(validate, lambda done, total: None)
    make_folder(trainer.out)
    with open_curves(trainer.out, recordings, step=trainer.step) as curves:

        def report(step: int, terms: dict[str, float]) -> None:
            curves.learned(step, terms)
            show(step, terms)
            if recordings and (step % every == 0 or step == trainer.config.steps):
                curves.validate(step, trainer.averaged())

        yield report
