"""How well `evimo calibrate CAPTURE` puts right what is planted in captures of simulated recordings.

    python bench/edge_alignment.py 201:1 203:4 --seconds 2      # seed:set of each recording

Each is captured virtually, mocap noise and all, and refined from the truth and from two planted errors.
"""

import argparse
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from evimo.calibrating import edges
from evimo.calibrating.edges import EdgeFit, refine_by_edges
from evimo.calibrating.fitting import Calibration
from evimo.calibrating.rigid import angle_between, nudged
from evimo.captures.capture import open_capture
from evimo.cli.calibrate_by_edges import captured_world, moments_of
from evimo.simulate.plan import RecordingPlan
from evimo.simulate.recording import simulate_recording
from evimo.simulate.virtual_capture import MocapErrors, Planted, capture_virtually

PLANTED = ((0.0, 0.0, 0.0, 0.0), (0.8, 3.0, 12.0, 0.0), (1.0, 5.0, -60.0, 100.0))  # degrees, mm, ms, ms of search
SIZE = (195, 260)
OFFSET_US = 7_000


def main() -> None:
    """Simulate, capture and refine every recording that is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", help="seed:set")
    parser.add_argument("--seconds", type=float, default=2.0)
    parser.add_argument("--bandwidth", type=float, help="Hz, of all pixels at white; 0 is infinitely fast")
    parser.add_argument("--without-shifts", action="store_true", help="as if events lay on outlines")
    given = parser.parse_args()
    if given.without_shifts:
        edges.ROUNDS = tuple(replace(each, shifts=False) for each in edges.ROUNDS)
    print("seed set movers Hz | planted deg mm ms | left deg mm ms | halves deg mm ms | on outlines | shifts | s")
    for words in given.recordings:
        seed, number = map(int, words.split(":"))
        recording = simulate_recording(RecordingPlan(seed=seed, set_number=number, seconds=given.seconds, size=SIZE))
        if given.bandwidth is not None:
            recording = replace(recording, settings=replace(recording.settings, bandwidth_hz=given.bandwidth))
        with tempfile.TemporaryDirectory() as folder:
            planted, _ = capture_virtually(recording, Path(folder) / "capture", MocapErrors(offset_us=OFFSET_US))
            measure(
                Path(folder) / "capture",
                planted,
                f"{seed} {number} {len(recording.scene.movers)} {recording.settings.bandwidth_hz:.0f}",
            )


def measure(folder: Path, planted: Planted, name: str) -> None:
    """Print a line for each planted error."""
    capture = open_capture(folder)
    events = capture.recording.opened()
    camera = capture.lens(events)
    world, moments = captured_world(capture, camera), moments_of(events)
    rng = np.random.default_rng(11)
    truth = Calibration(camera=camera, rig_from_cam=planted.body_from_cam, body_from_target=np.eye(4), offset_us=0.0)
    for degrees, mm, ms, search_ms in PLANTED:
        ways = rng.normal(size=(2, 3))
        ways *= np.array((1e-3 * mm, np.radians(degrees)))[:, None] / np.linalg.norm(ways, axis=1, keepdims=True)
        start = Calibration(
            camera=camera,
            rig_from_cam=nudged(planted.body_from_cam, ways.ravel()),
            body_from_target=np.eye(4),
            offset_us=1e3 * ms,
        )
        begun = time.perf_counter()
        fit = refine_by_edges(start, moments, world, search_us=1e3 * search_ms)
        took_s = time.perf_counter() - begun
        print(
            f"{name} | {left(start, truth)} | {left(fit.calibration, truth)} | {told(fit)} | {took_s:.0f}", flush=True
        )


def left(made: Calibration, truth: Calibration) -> str:
    """The angle, distance and time from one calibration to another."""
    degrees = np.degrees(float(angle_between(made.rig_from_cam, truth.rig_from_cam)))
    mm = 1e3 * np.linalg.norm(made.rig_from_cam[:3, 3] - truth.rig_from_cam[:3, 3])
    return f"{degrees:.3f} {mm:.2f} {1e-3 * (made.offset_us - truth.offset_us):+.2f}"


def told(fit: EdgeFit) -> str:
    """What the fit says of itself."""
    shifts = fit.shifts
    px = " ".join(f"{each:+.2f}" for each in (shifts.room, shifts.body, shifts.behind, shifts.dark))
    return f"{left(*fit.halves)} | {fit.before:.3f} {fit.after:.3f} | {px} px {1e-3 * shifts.on_lag_us:+.2f} ms"


if __name__ == "__main__":
    main()
