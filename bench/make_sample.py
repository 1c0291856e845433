"""Make the recording that ships in the package: two simulated seconds of a calm tabletop, in the EV-IMO layout.

python bench/make_sample.py [--out src/evimo/samples/tabletop.npz]
"""

import argparse
from pathlib import Path

import numpy as np

from evimo.events.events import joined
from evimo.simulate.plan import RecordingPlan
from evimo.simulate.recording import simulate_recording

SEED, SET, SECONDS, SIZE = 7000228, 4, 2.0, (180, 240)


def main() -> None:
    """Simulate, put the events into one array, save."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("src/evimo/samples/tabletop.npz"))
    out: Path = parser.parse_args().out
    recording = simulate_recording(
        RecordingPlan(seed=SEED, set_number=SET, seconds=SECONDS, camera="random", size=SIZE)
    )
    camera = recording.camera
    if not camera.is_pinhole:
        raise SystemExit("this seed has a lens, which the EV-IMO layout cannot hold")
    events = joined([part.events for part in recording])
    columns = (events.t * 1e-6, events.x, events.y, events.p > 0)
    intrinsics = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
    out.parent.mkdir(parents=True, exist_ok=True)
    no_masks = np.zeros((0, *SIZE), np.uint16)  # readers take the size of the sensor from its header
    events_txyp = np.stack(columns, axis=1).astype(np.float32)
    np.savez_compressed(out, events=events_txyp, K=intrinsics, mask=no_masks)


if __name__ == "__main__":
    main()
