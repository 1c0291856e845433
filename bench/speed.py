"""Speed of every stage on two cores: prints a table, writes out/bench.json. `make bench` runs this.

    python bench/speed.py [--only simulate,rendering,run,onnx,warping,labels,training] [--out out/bench.json]

Peers are timed in turn within this very run, and medians compared: absolute times mean little on a shared machine.
What cannot be measured here is listed with the reason. The JSON has one key per number; `rows` says more.
"""

import argparse
import json
import os
import platform
import shutil
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

CORES = 2
RUNS = 3
SIZE = (260, 346)
FOLDER = Path("out/bench")
SIMULATED = FOLDER / "simulated"
SEED = 90_000
MODEL = "small"
GOALS = ("value", "must", "aim")

Row = dict[str, Any]


class Skipped(Exception):
    """This cannot be measured here; the message says why."""


def evimo(*arguments: str | Path) -> float:
    """Run the command as a user does; wall time in s."""
    start = time.perf_counter()
    done = subprocess.run([sys.executable, "-m", "evimo.cli", *map(str, arguments)], capture_output=True, text=True)
    if done.returncode:
        reason = " ".join(done.stderr.split()[-40:])
        raise Skipped(f"evimo {arguments[0]} failed: {reason}")
    return time.perf_counter() - start


def simulate() -> Iterator[Row]:
    """Simulated slices per second of `evimo simulate`, start included, machine code cached by a first call."""
    plan = ("simulate", "--size", f"{SIZE[1]}x{SIZE[0]}", "--workers", str(CORES), "--seed", str(SEED))
    shutil.rmtree(SIMULATED, ignore_errors=True)
    evimo(*plan, "--minutes", "0.001", "--seconds", "0.05", "--out", FOLDER / "warm_up")
    shutil.rmtree(FOLDER / "warm_up", ignore_errors=True)
    recordings, seconds = 6, 1.0
    wall_s = evimo(*plan, "--minutes", str(recordings * seconds / 60), "--seconds", str(seconds), "--out", SIMULATED)
    slices = recordings * seconds / 0.025
    note = f"{recordings} recordings of {seconds:g} s, one of each set, {CORES} processes, start included"
    yield row("simulate_slices_per_s", slices / wall_s, "slices/s", must=3.4, aim=6.0, note=note)


def rendering() -> Iterator[Row]:
    """The renderer's frames per second beside Embree's of the same rays."""
    from rendering import rendering_rows

    yield from rendering_rows()
    if find_spec("embreex") is None:
        raise Skipped(
            "embreex is not installed, so that only our own renderer was timed: it needs evimo[dev] on x86-64"
        )


def full_size() -> Path:
    """A simulated recording of 346x260 px and 2 s; made once."""
    made = FOLDER / "full_size"
    if not any(made.glob("set*")):
        size = f"{SIZE[1]}x{SIZE[0]}"
        evimo(
            "simulate",
            "--set",
            "1",
            "--minutes",
            "0.03",
            "--seconds",
            "2",
            "--seed",
            str(SEED),
            "--size",
            size,
            "--out",
            made,
        )
    return next(iter(sorted(made.glob("set*"))))


def run() -> Iterator[Row]:
    """`evimo run` end to end with small, video off: slices per second after the first, and where the time goes."""
    from evimo import samples

    full, sample = full_size(), samples.path()
    ways = {"": (full, "--dense"), "_tables_only": (full, "--no-dense"), "_sample": (sample, "--dense")}
    summaries: dict[str, list[Row]] = {way: [] for way in ways}
    for _ in range(RUNS):
        for way, (source, option) in ways.items():
            folder = FOLDER / f"run{way}"
            wall_s = evimo("run", source, "--model", MODEL, "--no-video", option, "--out", folder)
            summaries[way].append(json.loads((folder / "summary.json").read_text()) | {"wall_s": wall_s})
    for way, parts in summaries.items():
        middle = sorted(parts, key=lambda part: part["slices_per_s"])[len(parts) // 2]
        source, option = ways[way]
        size = "240x180" if way == "_sample" else f"{SIZE[1]}x{SIZE[0]}"
        what = "tables, summary and dense maps" if option == "--dense" else "tables and summary"
        note = f"{source.name}, {size}, {middle['slices']} slices, {what}; {middle['startup_s']:.1f} s to the first"
        stages = {"stages_ms": middle["stages_ms"], "wall_s": middle["wall_s"]}
        goal = {"must": 25.0, "aim": 80.0} if way == "" else {}
        yield row(f"run_{MODEL}{way}_slices_per_s", middle["slices_per_s"], "slices/s", note=note, **goal, **stages)


def onnx() -> Iterator[Row]:
    """Both passes of one slice, as deployed against their own eager forward pass."""
    if find_spec("torch") is None:
        raise Skipped("torch is not installed: the eager pass needs evimo[train]")
    from evimo.errors import NotFound

    try:
        ms = medians_ms(ways_of_passes())
    except NotFound as error:
        raise Skipped(error.problem) from error
    for name in ("first", "second"):
        note = f"{MODEL}, {SIZE[1]}x{SIZE[0]}: ONNX Runtime {ms[name]:.1f} ms, eager {ms[f'eager_{name}']:.1f} ms"
        yield row(f"onnx_{name}_pass_ms", ms[name], "ms/slice", note=note)
    times = (ms["eager_first"] + ms["eager_second"]) / (ms["first"] + ms["second"])
    yield row("onnx_vs_eager", times, "times", must=1.3, aim=3.0, note="both passes", **ms)


def ways_of_passes() -> dict[str, Callable[[], Any]]:
    """Each pass of the network on one made-up slice, by ONNX Runtime and by torch."""
    import torch

    import evimo as package
    from evimo.events.local_motion import motion_candidates
    from evimo.events.stack import plane_fits, voxel_grid
    from evimo.model.export import FIRST_INPUTS, SECOND_INPUTS, First, Second
    from evimo.streaming.inference import Network, Seen

    network, model = Network(MODEL, workers=1, threads=CORES), package.load_model(MODEL)
    torch.set_num_threads(CORES)
    size = tuple(-(-side // network.stride) * network.stride for side in SIZE)
    half, stack = (size[0] // 2, size[1] // 2), random_stack(50_000)
    fits, valid = plane_fits(stack, half), np.ones(half, np.float32)
    lens = np.array([258, 258, 173, 130], np.float32), np.zeros(4, np.float32)
    first = Seen(voxel_grid(stack, half, step=2), fits, valid, *lens)
    second = Seen(voxel_grid(stack, (size[0], size[1])), fits, valid, *lens)
    candidates = motion_candidates(first.voxels)
    motion = network.first(first, candidates)
    taken = {"taken_ego": motion.ego, "taken_depth": motion.rel_depth[None], "taken_seen": motion.flow}

    def eager(part: torch.nn.Module, names: tuple[str, ...], feeds: dict[str, Any]) -> Callable[[], Any]:
        inputs = [torch.from_numpy(feeds[name][None]) for name in names]
        return torch.no_grad()(lambda: part.eval()(*inputs))

    return {
        "first": lambda: network.first(first, candidates),
        "second": lambda: network.second(second, motion),
        "eager_first": eager(First(model), FIRST_INPUTS, first.feeds() | {"candidates": candidates}),
        "eager_second": eager(Second(model), SECOND_INPUTS, second.feeds() | taken),
    }


def random_stack(count: int) -> Any:
    """Events of five slices at random places."""
    from evimo.events.stack import EventStack

    random = np.random.default_rng(0)
    x, y = (random.uniform(0, side - 1, count).astype(np.float32) for side in SIZE[::-1])
    return EventStack(x, y, random.uniform(-2.5, 2.5, count).astype(np.float32), random.random(count) < 0.5)


def labels() -> Iterator[Row]:
    """What a label for every event costs, on one core."""
    from labels import label_rows

    yield from label_rows(full_size(), MODEL)


def warping() -> Iterator[Row]:
    """The fine warp loss by splatting events, against grid_sample."""
    if find_spec("torch") is None:
        raise Skipped("torch is not installed: the losses need evimo[train]")
    from warping import warping_rows

    yield from warping_rows()


def training() -> Iterator[Row]:
    """How fast each preset learns, and how long it waits for data."""
    if find_spec("torch") is None:
        raise Skipped("torch is not installed: training needs evimo[train]")
    from training import training_rows

    yield from training_rows()


MEASUREMENTS: dict[str, Callable[[], Iterator[Row]]] = {
    "simulate": simulate,
    "rendering": rendering,
    "run": run,
    "onnx": onnx,
    "warping": warping,
    "labels": labels,
    "training": training,
}


def row(key: str, value: float, unit: str, *, note: str = "", **more: Any) -> Row:
    """One number with what it means."""
    return {"key": key, "value": value, "unit": unit, "note": note, **more}


def medians_ms(ways: dict[str, Callable[[], Any]], *, rounds: int = 21) -> dict[str, float]:
    """Each way once per round, in turn, after one call that is not counted; the median of its times."""
    times: dict[str, list[float]] = {name: [] for name in ways}
    for number in range(rounds + 1):
        for name, way in ways.items():
            start = time.perf_counter()
            way()
            if number:
                times[name].append((time.perf_counter() - start) * 1e3)
    return {name: statistics.median(each) for name, each in times.items()}


def as_table(rows: list[Row]) -> Table:
    """Numbers, goals, notes; where the time goes."""
    table = Table("what", "value", "unit", "must", "aim", "note", title="evimo bench", title_justify="left")
    for each in rows:
        goals = (f"{each[goal]:g}" if each.get(goal) else "–" for goal in ("must", "aim"))
        note = each.get("note") or ", ".join(
            f"{k} {v:.4g}" for k, v in each.items() if isinstance(v, float) and k not in GOALS
        )
        table.add_row(each["key"], f"{each['value']:.2f}", each.get("unit", "times"), *goals, note)
        for stage, ms in each.get("stages_ms", {}).items():
            table.add_row(f"   {stage}", f"{ms:.2f}", "ms/slice", "", "", "")
    return table


def main() -> None:
    """Measure, print, save."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default=",".join(MEASUREMENTS), help="comma-separated")
    parser.add_argument("--out", type=Path, default=Path("out/bench.json"))
    options = parser.parse_args()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:CORES])  # commands started from here inherit it
    FOLDER.mkdir(parents=True, exist_ok=True)
    rows: list[Row] = []
    skipped: dict[str, str] = {}
    console = Console(width=150)
    for name in options.only.split(","):
        console.print(f"measuring {name} …", style="dim")
        try:
            rows += MEASUREMENTS[name]()
        except Skipped as reason:
            skipped[name] = str(reason)
    console.print(as_table(rows))
    for name, reason in skipped.items():
        console.print(f"skipped {name}: {reason}", markup=False)
    machine = {"cores": CORES, "machine": platform.machine(), "python": platform.python_version()}
    numbers = {each["key"]: each["value"] for each in rows}
    content = numbers | {"rows": rows, "skipped": skipped, "machine": machine, "evimo": version("evimo")}
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text(json.dumps(content, indent=1) + "\n")
    console.print(f"saved in {options.out}")


if __name__ == "__main__":
    main()
