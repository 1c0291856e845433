"""Events to event frames, one thread, against numpy's bincount making the very same frames.

    python bench/slicing.py

All ways run in turn, each over the same slices at 346x260, and each round's times are compared with one another, in
processor time: absolute times mean little on a shared machine. Goals at 20,000 events per slice: must be 2.5 times as
fast, aim at 5.
"""

import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.events.events import Events
from evimo.events.frames import FrameMaker, PixelTable, identity_table
from evimo.events.slices import SLICE_US, Slice, in_slices
from evimo.geometry.camera import Camera
from evimo.geometry.rectification import rectified

SIZE = (260, 346)
BARREL = Camera(257.7, 257.6, 188.3, 131.6, *SIZE, (-0.363, 0.125, -1e-4, -5e-6))
PIXELS = SIZE[0] * SIZE[1]
MUST, AIM = 2.5, 5.0
PACKET = 10_000

Frame = NDArray[np.float32]
Way = Callable[[Slice, Frame], Any]


def moving_edges(per_slice: int, slices: int, *, edges: int = 60) -> Events:
    """Events along straight edges that move, 15 % of them of the other polarity; sorted by time."""
    random, (height, width) = np.random.default_rng(0), SIZE
    count = per_slice * slices
    t = np.sort(random.integers(0, slices * SLICE_US, count))
    edge = random.integers(0, edges, count)
    angle, length = random.uniform(0, np.pi, edges), random.uniform(20, 90, edges)
    speed = random.normal(0, 60, (2, edges))
    along = random.uniform(-0.5, 0.5, count) * length[edge]
    x = random.uniform(20, width - 20, edges)[edge] + np.cos(angle)[edge] * along + speed[0][edge] * t * 1e-6
    y = random.uniform(20, height - 20, edges)[edge] + np.sin(angle)[edge] * along + speed[1][edge] * t * 1e-6
    x, y = (x + random.normal(0, 0.6, count)) % width, (y + random.normal(0, 0.6, count)) % height
    brighter = (random.integers(0, 2, edges)[edge] > 0) ^ (random.random(count) < 0.15)
    return Events(x.astype(np.uint16), y.astype(np.uint16), t, np.where(brighter, 1, -1).astype(np.int8))


def frame_by_bincount(one: Slice, out: Frame) -> None:
    """Counts and mean time at the sensor's own pixels."""
    events, planes = one.events, out.reshape(3, -1)
    at = events.y.astype(np.intp) * SIZE[1] + events.x
    counts = np.bincount(at + PIXELS * (events.p < 0), minlength=2 * PIXELS).reshape(2, -1)
    planes[:2] = counts
    mean_by_bincount(np.bincount(at, events.t - one.start_us, PIXELS), counts[0] + counts[1], planes[2])


def splat_by_bincount(table: PixelTable) -> Way:
    """Counts and mean time through a table, bilinearly. The corners and their weights are made once, as ours are."""
    x, y = np.clip(table.x, 0, SIZE[1] - 1), np.clip(table.y, 0, SIZE[0] - 1)
    left, top = np.minimum(x.astype(np.intp), SIZE[1] - 2), np.minimum(y.astype(np.intp), SIZE[0] - 2)
    ax, ay = x - left, y - top
    corners = np.stack([(top + down) * SIZE[1] + left + right for down in (0, 1) for right in (0, 1)], axis=-1)
    weights = np.stack([(1 - ay) * (1 - ax), (1 - ay) * ax, ay * (1 - ax), ay * ax], axis=-1) * table.valid[..., None]
    corners, weights = corners.reshape(-1, 4), weights.reshape(-1, 4)

    def frame(one: Slice, out: Frame) -> None:
        events, planes = one.events, out.reshape(3, -1)
        pixel = events.y.astype(np.intp) * SIZE[1] + events.x
        at, weight = corners[pixel], weights[pixel]
        by_polarity = (at + PIXELS * (events.p < 0)[:, None]).ravel()
        counts = np.bincount(by_polarity, weight.ravel(), 2 * PIXELS).reshape(2, -1)
        planes[:2] = counts
        times = np.bincount(at.ravel(), (weight * (events.t - one.start_us)[:, None]).ravel(), PIXELS)
        mean_by_bincount(times, counts[0] + counts[1], planes[2])

    return frame


def mean_by_bincount(times: NDArray[Any], counts: NDArray[Any], out: NDArray[np.float32]) -> None:
    """Sums to means, 0 where there is nothing."""
    out[:] = 0
    np.divide(times, counts * SLICE_US, out=out, where=counts > 0, casting="unsafe")


def by_kernel(table: PixelTable) -> Way:
    """Ours."""
    maker = FrameMaker(table)
    return lambda one, out: maker.frame(one.events, start_us=one.start_us, out=out)


def check_same(ours: Way, peers: Way, slices: list[Slice]) -> None:
    """A comparison counts only if both make the same frames."""
    frames = np.full((2, 3, *SIZE), np.nan, np.float32)
    ours(slices[0], frames[0])
    peers(slices[0], frames[1])
    np.testing.assert_allclose(frames[0], frames[1], atol=1e-3)


def seconds_in_turn(ways: dict[str, Callable[[], Any]], rounds: int) -> dict[str, list[float]]:
    """Each way once per round, in turn, after one call that is not counted."""
    times: dict[str, list[float]] = {name: [] for name in ways}
    for number in range(rounds + 1):
        for name, way in ways.items():
            start = time.thread_time()
            way()
            if number:
                times[name].append(time.thread_time() - start)
    return times


def measured(per_slice: int, *, rounds: int = 21) -> dict[str, float]:
    """Mevents/s of each way, and how many times faster ours are: medians over rounds."""
    events = moving_edges(per_slice, slices=max(2, 1_000_000 // per_slice))
    slices = list(in_slices([events], stop_us=int(events.t[-1]) // SLICE_US * SLICE_US + SLICE_US))
    packets = [events.part(first, first + PACKET) for first in range(0, len(events), PACKET)]
    identity, lens = identity_table(*SIZE), PixelTable(*rectified(BARREL).table())
    ways = {"identity": by_kernel(identity), "bincount": frame_by_bincount}
    ways |= {"lens": by_kernel(lens), "lens_bincount": splat_by_bincount(lens)}
    check_same(ways["identity"], ways["bincount"], slices)
    check_same(ways["lens"], ways["lens_bincount"], slices)
    out = np.zeros((3, *SIZE), np.float32)

    def over_all(way: Way, source: Callable[[], Any]) -> Callable[[], None]:
        def run() -> None:
            for one in source():
                way(one, out)

        return run

    runs = {name: over_all(way, lambda: slices) for name, way in ways.items()}
    runs["packets"] = over_all(ways["identity"], lambda: in_slices(packets))
    times = seconds_in_turn(runs, rounds)
    numbers = {name: len(events) / statistics.median(each) / 1e6 for name, each in times.items()}
    for name, peer in (("identity", "bincount"), ("lens", "lens_bincount")):
        ratios = [theirs / ours for ours, theirs in zip(times[name], times[peer], strict=True)]
        numbers[f"{name}_ratio"] = statistics.median(ratios)
    return numbers


def slicing_rows() -> list[dict[str, Any]]:
    """For `bench/speed.py`: the goal at 20,000 events per slice, then the lens and large slices."""
    usual, large = measured(20_000), measured(1_000_000, rounds=7)

    def row(key: str, ratio: float, ours: float, theirs: float, what: str) -> dict[str, Any]:
        note = f"{what}: {ours:.0f} Mevents/s, numpy bincount {theirs:.0f}"
        return {"key": key, "value": ratio, "unit": "times", "note": note}

    first = row(
        "slicing_vs_bincount", usual["identity_ratio"], usual["identity"], usual["bincount"], "no lens, 20k/slice"
    )
    lens = (usual["lens_ratio"], usual["lens"], usual["lens_bincount"])
    big = (large["identity_ratio"], large["identity"], large["bincount"])
    return [
        first | {"must": MUST, "aim": AIM},
        row("slicing_lens_vs_bincount", *lens, "through a lens, bilinear, 20k/slice"),
        row("slicing_large_vs_bincount", *big, "no lens, 1M/slice"),
        {
            "key": "slicing_mevents_per_s",
            "value": usual["packets"],
            "unit": "Mevents/s",
            "note": f"packets of {PACKET} events cut into slices and turned into frames, no lens, 20k/slice",
        },
    ]


def main() -> None:
    """Print the rows."""
    from rich.console import Console
    from rich.table import Table

    table = Table("what", "value", "unit", "must", "aim", "note")
    for row in slicing_rows():
        goals = (f"{row[goal]:g}" if goal in row else "–" for goal in ("must", "aim"))
        table.add_row(row["key"], f"{row['value']:.2f}", row["unit"], *goals, row["note"])
    Console(width=150).print(table)


if __name__ == "__main__":
    main()
