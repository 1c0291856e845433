"""The training loop: batches in, checkpoints out; knows no formula."""

import json
import os
import time
from collections.abc import Callable, Generator, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict
from math import cos, isfinite, pi
from pathlib import Path

import numpy as np

from evimo.errors import BadInput
from evimo.model.checkpoint import load_tensors, save_model, save_tensors
from evimo.model.ecn import Ecn
from evimo.model.networks import Model
from evimo.training.batches import Batch
from evimo.training.config import TrainConfig
from evimo.training.data import Row, drawn_row, stacked
from evimo.training.devices import ALONE, Team
from evimo.training.learner import Learner
from evimo.training.recipes import RECIPES
from evimo.training.sources import Choices, Source
from evimo.writing import make_folder

MODEL, STATE = "model.safetensors", "state.safetensors"
SICK_STEPS = 20
"""In a row: a run whose loss is no number for so long has stopped learning."""


class Trainer:
    """One run in one folder; `run` goes on from the last checkpoint, exactly as if it had never stopped.

    Every sample depends on the seed, its step and its place in the batch alone, whatever process draws it.
    """

    def __init__(
        self,
        model: Model,
        config: TrainConfig,
        source: Source,
        out: Path,
        *,
        team: Team = ALONE,
        data: Mapping[str, str] | None = None,
    ) -> None:
        """See the class; `data` tells what is learned from, and what the model was before, from others.

        Raises:
            BadInput: no such recipe, or one for other networks; or more processes than samples in a batch.
        """
        if config.recipe not in RECIPES:
            raise BadInput(f"no recipe {config.recipe!r}", fix=f"one of {', '.join(RECIPES)}")
        fitting = [name for name, recipe in RECIPES.items() if isinstance(model, Ecn) != bool(recipe.first)]
        if config.recipe not in fitting:
            raise BadInput(
                f"the recipe {config.recipe!r} does not train this network", fix=f"--recipe {' or '.join(fitting)}"
            )
        if team.size > config.batch:
            raise BadInput(f"{team.size} processes for batches of {config.batch}", fix="a larger --batch")
        self.learner = Learner(model, config, team)
        self.config, self.out, self.source, self.team = config, out, source, team
        self._run = {
            "training": asdict(config),
            "config": asdict(model.config),
            "weights": asdict(RECIPES[config.recipe]),
            "data": dict(data or {}),
        }
        self.step = 0
        self.pace = Pace(config.batch)

    def run(self, report: Callable[[int, dict[str, float]], None]) -> None:
        """Train up to the last step; `report` gets the step and the loss terms of its batch.

        Raises:
            BadInput: the loss is no number, `SICK_STEPS` steps in a row.
        """
        make_folder(self.out)
        sick = 0
        try:
            with self._batches() as following:
                while self.step < self.config.steps:
                    with self.pace.waiting():
                        batch = next(following)
                    said = self._one_step(batch)
                    self.pace.add()
                    report(self.step, said)
                    sick = 0 if isfinite(said["loss"]) else sick + 1
                    if sick == SICK_STEPS:
                        raise _no_number(said, self.step)
                    if self.step % self.config.save_every == 0 and self.step < self.config.steps:
                        self.save()
        finally:
            if self.learner.whole:
                self.save()

    def _one_step(self, batch: Batch) -> dict[str, float]:
        done = self.step / self.config.steps
        rise = min(1.0, (self.step + 1) / self.config.warm_up)
        rate = self.config.learning_rate * rise * (0.01 + 0.99 * 0.5 * (1 + cos(pi * done)))
        keep = min(self.config.average, (self.step + 1) / (self.step + 11))
        said = self.learner.learn(batch, rate=rate, keep=keep)
        self.step += 1
        self.learner.whole = True
        return said

    @contextmanager
    def _batches(self) -> Generator[Iterator[Batch]]:
        """This process's shares of the batches from now on; one is drawn while the last is learned from."""
        ahead, threads = ThreadPoolExecutor(1), ThreadPoolExecutor(max(1, (os.cpu_count() or 2) // 2))
        pending: list[Future[Batch]] = []

        def following() -> Iterator[Batch]:
            step = self.step
            pending.append(ahead.submit(self._batch, step, threads))
            while True:
                batch = pending.pop().result()
                step += 1
                if step < self.config.steps:
                    pending.append(ahead.submit(self._batch, step, threads))
                yield batch

        try:
            yield following()
        finally:
            for executor in (ahead, threads):
                executor.shutdown(wait=False, cancel_futures=True)  # it may be waiting for a scene

    def _batch(self, step: int, threads: ThreadPoolExecutor) -> Batch:
        places = self.team.places(self.config.batch)
        choices = self.source(step, places)
        seeds = [(self.config.seed, step, place) for place in places]
        batch = stacked(list(threads.map(_drawn, choices, seeds)), events="fine_warp" in self.learner.recipe.weights)
        return batch if self.learner.device.type == "cpu" else batch.pinned()

    @property
    def samples_seen(self) -> int:
        """Samples so far in this run."""
        return self.step * self.config.batch

    def averaged(self) -> Model:
        """A model with the moving average of the weights, on the CPU."""
        return self.learner.averaged()

    def save(self) -> None:
        """Write the averaged weights as a model, and everything needed to go on; one process of a team does."""
        if self.team.rank:
            return
        facts = {"training": asdict(self.config), "step": self.step, "samples": self.samples_seen}
        save_tensors(self.learner.state(), self.out / STATE, **facts | self._run)
        save_model(self.averaged(), self.out / MODEL, **facts)

    def resume(self) -> bool:
        """Go on from the folder's last checkpoint, if there is one.

        Raises:
            BadInput: it is of another run: configuration, weights of the losses or recordings differ.
        """
        path = self.out / STATE
        if not path.exists():
            return False
        tensors, facts = load_tensors(path)
        if not {"weights", "data"} <= facts.keys():
            raise BadInput(
                f"{self.out} holds a run of an older version, which drew other samples",
                fix=f"another --out; to train it further, --preset {self.out / MODEL}",
            )
        ours = json.loads(json.dumps(self._run))
        told = {part: facts.get(part, {}) for part in ours}
        if changed := [name for part in ours for name in ours[part] if ours[part][name] != told[part].get(name)]:
            raise BadInput(
                f"{self.out} holds another run, which differs in {', '.join(changed)}",
                fix=f"the same options; or, to train it further, --preset {self.out / MODEL} and another --out",
            )
        self.learner.restore(tensors)
        self.step = int(facts["step"])
        return True


def _no_number(said: dict[str, float], step: int) -> BadInput:
    terms = ", ".join(name for name, value in said.items() if name != "loss" and not isfinite(value))
    return BadInput(
        f"nothing has been learned for {SICK_STEPS} steps up to {step}: the loss is no number ({terms})",
        fix="a lower --learning-rate in another --out, or recordings without damaged truth",
    )


class Pace:
    """How fast a run learns since its second step, and what share of the time it waits for data."""

    def __init__(self, batch: int) -> None:
        """`batch`: samples per step."""
        self._batch, self._steps, self._waited_s, self._begun_s = batch, -1, 0.0, 0.0

    def add(self) -> None:
        """One more step is done; the first one, which compiles, begins the count."""
        if self._steps < 0:
            self._begun_s, self._waited_s = time.perf_counter(), 0.0
        self._steps += 1

    @contextmanager
    def waiting(self) -> Generator[None]:
        """Count the time in the `with` as waiting."""
        begun_s = time.perf_counter()
        yield
        self._waited_s += time.perf_counter() - begun_s

    @property
    def samples_per_s(self) -> float:
        """Samples learned from per second, of all processes together."""
        return max(self._steps, 0) * self._batch / self._elapsed_s

    @property
    def waited(self) -> float:
        """Share of the time, 0...1, that was spent waiting for data."""
        return self._waited_s / self._elapsed_s if self._steps > 0 else 0.0

    @property
    def _elapsed_s(self) -> float:
        return max(time.perf_counter() - self._begun_s, 1e-9)


def _drawn(choices: Choices, seed: tuple[int, int, int]) -> Row:
    """A sample of one of some sets, which are equally likely."""
    rng = np.random.default_rng(seed)
    return drawn_row(choices[rng.integers(len(choices))], rng)
