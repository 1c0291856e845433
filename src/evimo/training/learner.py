"""One step of learning: gradients of a batch, summed over the team, Adam, and the moving average of the weights."""

import warnings

import torch
from torch import Tensor

from evimo.errors import EvimoWarning
from evimo.model.networks import Model, compute_in, network_of
from evimo.training.batches import Batch
from evimo.training.config import TrainConfig
from evimo.training.devices import Team
from evimo.training.graphs import Pass, captured
from evimo.training.objective import objective
from evimo.training.recipes import RECIPES


class Learner:
    """A model that learns from batches.

    The loss of a batch is the mean over its samples (`objective`): a process weighs the loss of its share of the batch
    by the number of its samples, and the sum over all processes is the loss and the gradient of the whole batch.
    """

    def __init__(self, model: Model, config: TrainConfig, team: Team) -> None:
        """See the class; on a GPU, features lie channels-last, and the passes are replayed from a CUDA graph."""
        self.device = next(model.parameters()).device
        if self.device.type == "cuda":
            model.to(memory_format=torch.channels_last)  # pyright: ignore[reportCallIssue]  # missing in torch's types
        self.model, self.config, self.team = model.train(), config, team
        self.recipe = RECIPES[config.recipe]
        compute_in(model, torch.bfloat16 if config.bfloat16 else torch.float32)
        self.optimizer = torch.optim.Adam(model.parameters(), lr=config.learning_rate, betas=(0.9, 0.99))
        self.average = {name: value.detach().clone() for name, value in model.state_dict().items()}
        self._names: list[str] = []
        self._pass: Pass | None = None
        self.replays_graph = False
        self.whole = True
        """Whether weights, moments and average are of one step: not where an interrupt came while they changed."""

    def learn(self, batch: Batch, *, rate: float, keep: float) -> dict[str, float]:
        """Learn from this process's share of a batch; returns the loss and its terms of the whole batch.

        Args:
            batch: on the CPU.
            rate: of learning.
            keep: decay of the moving average.

        Leaves `whole` to be set by the caller, when the step is counted.
        """
        for group in self.optimizer.param_groups:
            group["lr"] = rate
        self._pass = self._pass or self._fastest_pass(batch)
        said = self._pass(batch)
        gradients = [value.grad for value in self.model.parameters() if value.grad is not None]
        self.team.sum([said, *gradients])
        self.whole = False
        norm = torch.nn.utils.clip_grad_norm_(self.model.parameters(), 1.0)
        if torch.isfinite(norm):  # one sick sample may not spoil the run
            self.optimizer.step()
        for name, value in self.model.state_dict().items():
            self.average[name].lerp_(value.detach(), 1 - keep)
        return dict(zip(self._names, said.tolist(), strict=True))

    def averaged(self) -> Model:
        """A model with the moving average of the weights, on the CPU."""
        model = network_of(self.model.config)
        model.load_state_dict({name: value.cpu() for name, value in self.average.items()})
        return model.eval()

    def state(self) -> dict[str, Tensor]:
        """Everything that later steps depend on."""
        tensors = {f"model.{name}": value for name, value in self.model.state_dict().items()}
        tensors |= {f"average.{name}": value for name, value in self.average.items()}
        for number, state in self.optimizer.state_dict()["state"].items():
            tensors |= {f"adam.{number}.{name}": torch.as_tensor(value) for name, value in state.items()}
        return tensors

    def restore(self, tensors: dict[str, Tensor]) -> None:
        """Go on from what `state` returned."""
        self.model.load_state_dict(_part(tensors, "model."))
        average = _part(tensors, "average.")
        self.average = {name: _like(value, average[name]) for name, value in self.model.state_dict().items()}
        state: dict[int, dict[str, Tensor]] = {}
        for name, value in _part(tensors, "adam.").items():
            number, key = name.split(".", 1)
            state.setdefault(int(number), {})[key] = value
        self.optimizer.load_state_dict({**self.optimizer.state_dict(), "state": state})
        for parameter, moments in self.optimizer.state.items():
            for name in ("exp_avg", "exp_avg_sq"):
                moments[name] = _like(parameter, moments[name])

    def _fastest_pass(self, batch: Batch) -> Pass:
        """From a CUDA graph where that can be; a batch with events has no fixed size."""
        if self.device.type != "cuda" or batch.events is not None:
            return self._eager_pass
        try:
            replayed = captured(self._eager_pass, batch)
            self.replays_graph = True
            return replayed
        except RuntimeError as error:
            problem = f"training step by step, as a CUDA graph cannot hold it: {error}"
            warnings.warn(EvimoWarning(problem), stacklevel=2)
            return self._eager_pass

    def _eager_pass(self, batch: Batch) -> Tensor:
        """Leave this share's part of the gradients; return its part of the loss and of the terms."""
        self.model.zero_grad(set_to_none=True)
        loss, terms = objective(self.model, batch.to(self.device), self.recipe)
        share = len(batch.ego) / self.config.batch
        (loss * share).backward()
        self._names = ["loss", *terms]
        return torch.stack([loss.detach(), *terms.values()]) * share


def _like(model: Tensor, value: Tensor) -> Tensor:
    """The value on the device and in the memory layout of another tensor: mixed layouts are updated one by one."""
    return torch.empty_like(model, requires_grad=False).copy_(value)


def _part(tensors: dict[str, Tensor], prefix: str) -> dict[str, Tensor]:
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}
