"""What a GPU does for the simulator: slices/s, frames/s, and how far it agrees with the CPU. Writes JSON.

    python bench/gpu.py [--out out/gpu.json]                     # on a machine with an NVIDIA GPU and evimo[cuda]
    NUMBA_ENABLE_CUDASIM=1 python bench/gpu.py --toy             # that the script works; its rates mean nothing

The scenes are fixed: one of each set from seed 90000, 346x260 px. A slice is made as training takes it, events and
truth in the rectified image, in memory; drawing the scenes, which the CPU does, is timed apart. First calls, which
compile, are not timed.
"""

import argparse
import json
import statistics
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from evimo.errors import EvimoError
from evimo.scene.cuda_renderer import CudaRenderer
from evimo.scene.rays.on_device import SIMULATED, check_cuda, cuda
from evimo.scene.renderer import Renderer
from evimo.simulate import film
from evimo.simulate.bands import Fed
from evimo.simulate.cuda_film import CudaFilm
from evimo.simulate.cuda_pixels import CudaPixels
from evimo.simulate.film import steps
from evimo.simulate.pixels import Pixels, blurred
from evimo.simulate.plan import RecordingPlan
from evimo.simulate.prepared import filmed
from evimo.simulate.recording import SLICE_S, SimulatedRecording, simulate_recording

SEED = 90_000
ROUNDS = 5
COMPARED = 8  # frames of each scene that are compared


def timed(work: Callable[[], Any]) -> float:
    """Wall time in s, until the GPU is done."""
    start = time.perf_counter()
    work()
    cuda.synchronize()
    return time.perf_counter() - start


def agreement(recording: SimulatedRecording, frames: int) -> dict[str, float]:
    """Of frames without strides, and of the events that one slice's frames fire from the same signal."""
    renderer, times = Renderer(recording.scene, recording.camera), np.linspace(0, recording.plan.seconds, frames)
    mine = renderer.frames(times)
    image, depth, tags = (values.copy_to_host() for values in CudaRenderer(renderer).frames(times))
    ids, its = (renderer.packed.ids[np.maximum(each, 0) >> 3] for each in (mine.tags, tags))
    time_s = steps(renderer, 0.0, SLICE_S)[0][: frames + 1]
    images = blurred(renderer.frames(time_s).image, recording.settings.blur_px)
    pixels = [Pixels(recording.settings, np.random.default_rng(0), first=images[0], start_s=0.0) for _ in range(2)]
    on_gpu = CudaPixels(pixels[1])
    fed: Any = on_gpu.fed(cuda.to_device(images), pixels[0].exposures(time_s))
    events = pixels[0].events_of(Fed(*(values.copy_to_host() for values in fed)))
    its_events = on_gpu.events(fed)
    same = len(events) == len(its_events)
    alike = np.logical_and.reduce([getattr(events, c) == getattr(its_events, c) for c in "xytp"]) if same else [0.0]
    return {
        "ids_alike": float((ids == its).mean()),
        "faces_alike": float((mine.tags == tags).mean()),
        "intensity_p999": float(np.percentile(np.abs(mine.image - image), 99.9)),
        "depth_p999": float(np.percentile(np.abs(depth / mine.depth - 1), 99.9)),
        "events_alike": float(np.mean(alike)) if len(events) else 1.0,
    }


def rates(recording: SimulatedRecording, frames: int, rounds: int) -> dict[str, float]:
    """Frames/s of rendering, of everything up to events, of the CPU's share; slices/s into what training reads."""
    renderer, times = Renderer(recording.scene, recording.camera), np.linspace(0, recording.plan.seconds, frames)
    on_gpu = CudaRenderer(renderer)
    filming = CudaFilm(renderer, recording.settings, np.random.default_rng(0), start_s=0.0)
    works = {
        "frames_per_s": (frames, lambda: on_gpu.frames(times)),
        "film_frames_per_s": (frames, lambda: filming.pixels.events(filming.fed(times)[0])),
        "slices_per_s": (recording.slices, lambda: filmed(recording)),
        "placed_frames_per_s": (frames, lambda: renderer.packed.placed(times)),
    }  # fmt: skip
    for _, work in works.values():
        timed(work)
    return {
        name: number / statistics.median(timed(work) for _ in range(rounds)) for name, (number, work) in works.items()
    }


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """Everything, by name, with the machine it was measured on."""
    name = b"numba's simulator, on a CPU" if SIMULATED else cuda.get_current_device().name
    device = name.decode() if isinstance(name, bytes) else name
    found: dict[str, Any] = {"device": device, "numba": version("numba"), "size": list(options.size), "scenes": []}
    found["numba_cuda"] = None if SIMULATED else version("numba-cuda")
    for number in options.sets:
        start = time.perf_counter()
        recording = simulate_recording(
            RecordingPlan(
                seed=SEED + number, set_number=number, seconds=options.seconds, size=options.size, device="cuda"
            )
        )
        drawn = {"set": number, "drawing_s": time.perf_counter() - start, "slices": recording.slices}
        drawn |= agreement(recording, min(options.frames, COMPARED)) | rates(recording, options.frames, options.rounds)
        print(f"set {number}: " + ", ".join(f"{name} {value:.6g}" for name, value in drawn.items() if name != "set"))
        found["scenes"].append(drawn)
    names = [name for name in found["scenes"][0] if name != "set"]
    found |= {name: statistics.median(scene[name] for scene in found["scenes"]) for name in names}
    return found


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("out/gpu.json"))
    parser.add_argument("--toy", action="store_true", help="one scene, 16x12 px, one slice")
    options = parser.parse_args()
    options.size, options.frames, options.seconds = ((12, 16), 2, SLICE_S) if options.toy else ((260, 346), 256, 1.0)
    options.sets, options.rounds = ((2,), 1) if options.toy else (range(1, 7), ROUNDS)
    if options.toy:
        film.SHORTEST_S = film.LONGEST_S  # few frames
    try:
        check_cuda()
        found = measured(options)
    except EvimoError as error:
        raise SystemExit(f"error: {error}") from error
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text(json.dumps(found, indent=1))
    print(f"{options.out}: medians of {len(found['scenes'])} scenes on {found['device']}")
    for name in ("slices_per_s", "frames_per_s", "film_frames_per_s", "ids_alike", "intensity_p999", "events_alike"):
        print(f"  {name:20} {found[name]:.6g}")


if __name__ == "__main__":
    main()
