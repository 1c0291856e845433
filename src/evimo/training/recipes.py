"""What is minimised: weights of the loss terms by name. Formulas are in `losses`."""

from dataclasses import dataclass, field


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """Weights of the terms of `objective.terms`; a term that is not named has weight 0.

    motion_first: share of the steps in which the mask terms wait for the motion terms.
    moving_share: what moving pixels weigh in a sample's mask loss, whatever their number.
    """

    weights: dict[str, float] = field(default_factory=dict)
    motion_first: float = 0.0
    moving_share: float = 0.0


RECIPES = {
    # The paper: supervised depth and masks (one-sided), everything else by warping.
    "paper": Recipe(
        weights={
            "coarse_warp": 1.0,
            "fine_warp": 1.0,
            "mask_one_sided": 1.0,
            "mask_smoothness": 0.1,
            "depth": 0.5,
            "depth_smoothness": 0.1,
        }
    ),
    # What ships: the simulator's own flow and twist supervise motion, both sides of the mask count.
    "shipped": Recipe(
        weights={
            "seen": 1.0,
            "flow": 0.5,
            "twist": 0.5,
            "velocity": 0.2,
            "direction": 0.1,
            "mask": 1.0,
            "dice": 0.7,
            "mask_smoothness": 0.02,
            "depth": 0.3,
            "depth_smoothness": 0.02,
        },
        motion_first=0.15,
        moving_share=0.12,
    ),
}
