"""What a training run is: everything that its checkpoints carry."""

from dataclasses import dataclass


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
