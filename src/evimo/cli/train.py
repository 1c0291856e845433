"""`evimo train`: train a model on simulated recordings."""

from pathlib import Path
from typing import TYPE_CHECKING

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from evimo.errors import MissingExtra

if TYPE_CHECKING:
    from evimo.training.config import TrainConfig


def train(
    *data: Path,
    preset: str = "small",
    out: Path,
    recipe: str = "shipped",
    steps: int = 4000,
    batch: int = 8,
    learning_rate: float = 2e-3,
    seed: int = 0,
    device: str = "cpu",
    threads: int | None = None,
) -> None:
    """Train on simulated recordings; the same command again goes on where it stopped.

    Leaves `model.safetensors` (averaged weights with their configuration), `model.onnx` with `model.first.onnx` (to
    run) and `log.csv` in the output folder. Each recording is brought into its rectified image once, in a folder inside
    it.

    Args:
        data: folders of recordings made by `evimo simulate`.
        preset: a shape to start afresh, `base`, `small` or `tiny`, or a .safetensors file to train further.
        out: folder of the run.
        recipe: `shipped` (supervised by the simulator) or `paper` (its losses only).
        steps: batches.
        batch: samples per batch.
        learning_rate: highest; a half cosine follows.
        seed: of the first weights and of the batches.
        device: `cpu` or `cuda`.
        threads: of the CPU; all by default.
    """
    from evimo.training.config import TrainConfig

    config = TrainConfig(recipe=recipe, steps=steps, batch=batch, learning_rate=learning_rate, seed=seed)
    _train(list(data), preset, config, out, device=device, threads=threads)


def _train(
    data: list[Path], preset: str, config: "TrainConfig", out: Path, *, device: str, threads: int | None
) -> None:
    """Prepare, train, export, with a bar for each."""
    try:
        import torch

        from evimo.model.export import export
        from evimo.training.start import log_rows, start
    except ImportError as error:
        raise MissingExtra("training needs torch", fix='pip install "evimo[train]"') from error
    if threads:
        torch.set_num_threads(threads)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, TextColumn("{task.fields[facts]}")) as progress:

        def prepared(done: int, total: int) -> None:
            progress.update(preparing, completed=done, total=total)

        preparing = progress.add_task("prepare", total=None, facts="")
        trainer = start(data, preset, config, out, device=device, progress=prepared)
        steps_task = progress.add_task("train", total=config.steps, completed=trainer.step, facts="")

        out.mkdir(parents=True, exist_ok=True)
        with log_rows(out / "log.csv") as log:

            def report(step: int, terms: dict[str, float]) -> None:
                log(step, terms)
                progress.update(steps_task, completed=step, facts=f"loss {terms['loss']:.3f}")

            trainer.run(report)
    export(trainer.averaged(), out / "model.onnx")
