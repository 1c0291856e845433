"""Speed of the classical method's parts on one core, for a slice of 20,000 events at 346x260.

    python bench/classical.py [--repeats 1000]

Each part is timed many times in turn and the least time is told: on a shared machine the others measure the neighbours.
"""

import argparse
import os
import time
from collections.abc import Callable

import cv2
import numpy as np

from evimo.classical.compensation import Parameters, compensate, world_and_misfit
from evimo.classical.misfit import misfit
from evimo.classical.world import FINE_EVENTS, Scene, coarse_motion

SIZE = (260, 346)
CENTRE = (172.5, 129.5)


def crowded_scene(per_slice: int = 25_700) -> Scene:
    """A textured picture that shifts, grows and turns, and a box over a tenth of it that moves otherwise."""
    random = np.random.default_rng(0)
    count = round(2 * per_slice)  # a window of one slice to either side of the centre
    edges = 300
    middle, angle = random.uniform((-20, -20), (366, 280), (edges, 2)), random.uniform(0, np.pi, edges)
    edge, along, t = random.integers(0, edges, count), random.uniform(-20, 20, count), random.uniform(-1, 1, count)
    at = middle[edge] + along[:, None] * np.column_stack((np.cos(angle), np.sin(angle)))[edge]
    from_centre = at - CENTRE
    flow = (4.0, -2.0) + 0.02 * from_centre + 0.01 * np.column_stack((-from_centre[:, 1], from_centre[:, 0]))
    inside = ((at > (180, 100)) & (at < (280, 190))).all(axis=1)
    x, y = np.rint(at + t[:, None] * np.where(inside[:, None], (-5.0, 1.0), flow)).T
    seen = (x >= 0) & (x < SIZE[1]) & (y >= 0) & (y < SIZE[0])
    return Scene(*(each[seen].astype(np.float32) for each in (x, y, t)), SIZE, CENTRE)


def least_ms(ways: dict[str, Callable[[], object]], repeats: int) -> dict[str, float]:
    """The least time of each, all in turn."""
    least = dict.fromkeys(ways, np.inf)
    for _ in range(repeats):
        for name, way in ways.items():
            start = time.perf_counter()
            way()
            least[name] = min(least[name], (time.perf_counter() - start) * 1e3)
    return least


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=1000)
    repeats = parser.parse_args().repeats
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:1])
    cv2.setNumThreads(1)
    scene, parameters = crowded_scene(), Parameters()
    world, _ = world_and_misfit(scene, parameters)
    ways: dict[str, Callable[[], object]] = {
        "coarse motion of the world": lambda: coarse_motion(scene.thinned(FINE_EVENTS)),
        "misfit": lambda: misfit(scene, world),
        "four parameters and what does not fit them": lambda: world_and_misfit(scene, parameters),
        "all, with the motion of regions": lambda: compensate(scene, parameters),
    }
    print(f"{np.count_nonzero(np.abs(scene.t) <= 0.5)} events in the slice, {len(scene.t)} in the window")
    for name, ms in least_ms(ways, repeats).items():
        print(f"{ms:7.2f} ms  {name}")


if __name__ == "__main__":
    main()
