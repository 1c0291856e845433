"""Where the samples of a batch come from: recordings in folders, scenes filmed meanwhile, or both."""

from collections.abc import Callable, Sequence

from evimo.training.data import Samples

Choices = tuple[Samples, ...]
Source = Callable[[int, Sequence[int]], Sequence[Choices]]
"""Of a step and places in its batch: sets of samples for each place, of which each is as likely as the others."""


def from_folders(samples: Samples) -> Source:
    """Every sample of some recordings, at any step and place."""
    return lambda _, places: [(samples,)] * len(places)


def joined(samples: Samples | None, filmed: Source | None, populations: int) -> Source:
    """What there is of recordings in folders and of filmed populations; folders are then one more population."""
    if filmed is None:
        assert samples is not None
        return from_folders(samples)
    if samples is None:
        return filmed
    return lambda step, places: [(*choices * populations, samples) for choices in filmed(step, places)]
