"""What is minimised: weights of the loss terms by name. Formulas are in `losses`."""

from dataclasses import dataclass, field


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """Weights of the terms of `objective`; a term that is not named has weight 0.

    first:        terms of the first pass; a network that looks once is trained by recipes without any.
    weights:      terms of the answer, that is of the second pass.
    moving_share: what moving pixels weigh in a sample's mask loss, whatever their number.
    """

    first: dict[str, float] = field(default_factory=dict)
    weights: dict[str, float] = field(default_factory=dict)
    moving_share: float = 0.0


RECIPES = {
    # The paper: supervised depth and masks (one-sided), everything else by warping.
    "paper": Recipe(
        first={"coarse_warp": 1.0, "fine_warp": 1.0, "depth": 0.5},
        weights={
            "coarse_warp": 1.0,
            "fine_warp": 1.0,
            "mask_one_sided": 1.0,
            "mask_smoothness": 0.1,
            "depth": 0.5,
            "depth_smoothness": 0.1,
        },
    ),
    # The paper's rival, by warping alone; it needs no truth.
    "ecn": Recipe(weights={"coarse_warp": 1.0, "fine_warp": 1.0, "depth_smoothness": 0.1}),
    # What ships: the simulator's own flow and twist supervise motion, both sides of the mask count.
    "shipped": Recipe(
        first={"seen": 1.0, "rigid": 0.5, "twist": 0.5, "depth": 0.3},
        weights={
            "seen": 1.0,
            "twist": 0.3,
            "velocity": 0.2,
            "direction": 0.1,
            "mask": 1.0,
            "dice": 0.7,
            "mask_smoothness": 0.02,
            "depth": 0.2,
        },
        moving_share=0.06,
    ),
}
