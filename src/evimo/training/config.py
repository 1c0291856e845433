"""What a training run is: everything that its checkpoints carry."""

from dataclasses import dataclass
from math import inf

from evimo.errors import BadInput


@dataclass(frozen=True, kw_only=True)
class TrainConfig:
    """One run; with the data it determines every number.

    recipe:        name of the weights of the loss terms.
    steps:         batches.
    batch:         samples per batch.
    learning_rate: at its highest; the paper has 1e-2 with batches of 32.
    warm_up:       steps until then; a half cosine to a hundredth of it is on top.
    average:       decay of the moving average of the weights, which is what is saved.
    seed:          of the first weights and of every batch.
    save_every:    steps between checkpoints.
    simulate:      populations of scenes that are filmed meanwhile, with equal shares; with recordings in folders, those
        are one more population.
    samples_per_slice: how often a filmed slice is the middle of a sample, on average, before it is forgotten.
    bfloat16:      whether features are computed in half the precision; 1.6 times as fast on CPUs that know it.

    Raises:
        BadInput: a number that no run can have.
    """

    recipe: str = "shipped"
    steps: int = 4000
    batch: int = 8
    learning_rate: float = 2e-3
    warm_up: int = 100
    average: float = 0.998
    seed: int = 0
    save_every: int = 200
    simulate: tuple[str, ...] = ()
    samples_per_slice: int = 4
    bfloat16: bool = True

    def __post_init__(self) -> None:
        counts = {"steps": self.steps, "samples in a batch": self.batch, "samples per slice": self.samples_per_slice}
        for name, count in counts.items():
            if count < 1:
                raise BadInput(f"{count} {name}", fix="1 or more")
        if self.seed < 0:
            raise BadInput(f"seed {self.seed}", fix="a seed from 0")
        if not 0 < self.learning_rate < inf:
            raise BadInput(f"a learning rate of {self.learning_rate:g}", fix="a positive number, such as 0.002")
