"""The training loop: batches in, checkpoints out; knows no formula."""

import json
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from math import cos, pi
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from evimo.errors import BadInput
from evimo.model.checkpoint import load_tensors, save_model, save_tensors
from evimo.model.motion_net import MotionNet
from evimo.training.batches import Batch
from evimo.training.config import TrainConfig
from evimo.training.data import Samples, drawn_batch
from evimo.training.objective import objective
from evimo.training.recipes import RECIPES

MODEL, STATE = "model.safetensors", "state.safetensors"


class Trainer:
    """One run in one folder; `run` goes on from the last checkpoint, exactly as if it had never stopped.

    Every batch depends on the seed and the number of its step alone.
    """

    def __init__(
        self,
        model: MotionNet,
        config: TrainConfig,
        samples: Samples,
        out: Path,
    ) -> None:
        """See the class."""
        if config.recipe not in RECIPES:
            raise BadInput(f"no recipe {config.recipe!r}", fix=f"one of {', '.join(RECIPES)}")
        self.model, self.config, self.out = model, config, out
        self.recipe = RECIPES[config.recipe]
        self.samples = samples
        model.compute_in(torch.bfloat16 if config.bfloat16 else torch.float32)
        self.step = 0
        self.device = str(next(model.parameters()).device)
        self.optimizer = torch.optim.Adam(model.parameters(), lr=config.learning_rate, betas=(0.9, 0.99))
        self.average = {name: value.detach().clone() for name, value in model.state_dict().items()}

    def run(self, report: Callable[[int, dict[str, float]], None]) -> None:
        """Train up to the last step; `report` gets the step and the loss terms of its batch."""
        self.out.mkdir(parents=True, exist_ok=True)
        self.model.train()
        drawer = ThreadPoolExecutor(1)  # draws the next batch while this one is learned from
        try:
            following = drawer.submit(self._batch, self.step)
            while self.step < self.config.steps:
                batch, following = following.result(), drawer.submit(self._batch, self.step + 1)
                report(self.step + 1, self._one_step(batch.to(self.device)))
                if self.step % self.config.save_every == 0 and self.step < self.config.steps:
                    self.save()
        finally:
            drawer.shutdown(cancel_futures=True)
            self.save()

    def _one_step(self, batch: Batch) -> dict[str, float]:
        done = self.step / self.config.steps
        rise = min(1.0, (self.step + 1) / self.config.warm_up)
        for group in self.optimizer.param_groups:
            group["lr"] = self.config.learning_rate * rise * (0.01 + 0.99 * 0.5 * (1 + cos(pi * done)))
        loss, terms = objective(self.model, batch, self.recipe)
        self.optimizer.zero_grad(set_to_none=True)
        loss.backward()
        norm = torch.nn.utils.clip_grad_norm_(self.model.parameters(), 1.0)
        if torch.isfinite(norm):  # one sick sample may not spoil the run
            self.optimizer.step()
        self.step += 1
        keep = min(self.config.average, self.step / (self.step + 10))
        for name, value in self.model.state_dict().items():
            self.average[name].lerp_(value.detach(), 1 - keep)
        return {"loss": float(loss.detach()), **terms}

    def _batch(self, step: int) -> Batch:
        rng = np.random.default_rng((self.config.seed, step))
        events = "fine_warp" in self.recipe.weights
        return drawn_batch(self.samples, self.config.batch, rng, events=events)

    @property
    def samples_seen(self) -> int:
        """Samples so far in this run."""
        return self.step * self.config.batch

    def averaged(self) -> MotionNet:
        """A model with the moving average of the weights, on the CPU."""
        model = MotionNet(self.model.config)
        model.load_state_dict({name: value.cpu() for name, value in self.average.items()})
        return model.eval()

    def save(self) -> None:
        """Write the averaged weights as a model, and everything needed to go on."""
        facts = {"training": asdict(self.config), "step": self.step, "samples": self.samples_seen}
        tensors = {f"model.{name}": value for name, value in self.model.state_dict().items()}
        tensors |= {f"average.{name}": value for name, value in self.average.items()}
        for number, state in self.optimizer.state_dict()["state"].items():
            tensors |= {f"adam.{number}.{name}": torch.as_tensor(value) for name, value in state.items()}
        save_tensors(tensors, self.out / STATE, **facts, config=asdict(self.model.config))
        save_model(self.averaged(), self.out / MODEL, **facts)

    def resume(self) -> bool:
        """Go on from the folder's last checkpoint, if there is one.

        Raises:
            BadInput: it is of another run: the configuration differs.
        """
        path = self.out / STATE
        if not path.exists():
            return False
        tensors, facts = load_tensors(path)
        ours = json.loads(json.dumps({"training": asdict(self.config), "config": asdict(self.model.config)}))
        if changed := [name for part in ours for name in ours[part] if ours[part][name] != facts[part].get(name)]:
            raise BadInput(
                f"{self.out} holds a run with another {', '.join(changed)}", fix="the same options, or another --out"
            )
        self.model.load_state_dict(_part(tensors, "model."))
        self.average = _part(tensors, "average.")
        state: dict[int, dict[str, Tensor]] = {}
        for name, value in _part(tensors, "adam.").items():
            number, key = name.split(".", 1)
            state.setdefault(int(number), {})[key] = value
        self.optimizer.load_state_dict({**self.optimizer.state_dict(), "state": state})
        self.average = {name: value.to(self.device) for name, value in self.average.items()}
        self.step = int(facts["step"])
        return True


def _part(tensors: dict[str, Tensor], prefix: str) -> dict[str, Tensor]:
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}
