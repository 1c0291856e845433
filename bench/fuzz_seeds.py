"""The whole recordings, calibrations, captures and predictions that `fuzz.py` damages."""

import json
import pickle
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import fuzz_predictions
import fuzz_truth
import numpy as np

from evimo.events.events import Events
from evimo.formats.saving import SAVE, save_events

SIZE = (48, 64)
HEAD = 1 << 16  # bytes of a real recording
RAN = "ran_what_the_file_says"

Kind = Literal["recording", "calibration", "predictions", "capture"]


@dataclass(frozen=True)
class Seed:
    """Whole files by name, what they hold, and which of them is opened ("" is the folder)."""

    name: str
    files: dict[str, bytes]
    opened: str
    kind: Kind = "recording"


def some_events(count: int = 2000) -> Events:
    """Sorted events of a small sensor."""
    rng = np.random.default_rng(0)
    x, y = (rng.integers(0, side, count).astype(np.uint16) for side in SIZE[::-1])
    return Events(x, y, np.sort(rng.integers(0, 200_000, count)), rng.choice(np.array((-1, 1), np.int8), count))


class Payload:
    """An object whose pickle makes a file when it is loaded."""

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (Path(RAN),)


def text_seeds(events: Events) -> Iterator[Seed]:
    """Text in several layouts."""
    columns = {"t": events.t, "x": events.x, "y": events.y, "p": events.p > 0}
    layouts = {
        "txyp": ("", " "),
        "xytp": ("x,y,t,p\n", ","),
        "xypt": ("%geometry:64,48\n", ","),
        "ptxy": ("p;t;x;y\n", ";"),
    }
    for order, (head, between) in layouts.items():
        rows = np.stack([columns[name] for name in order], axis=1)[:300].tolist()
        lines = head + "".join(between.join(map(str, row)) + "\n" for row in rows)
        yield Seed(f"text {order}", {"a.txt": lines.encode()}, "a.txt")
    seconds = "".join(f"{t / 1e6:.6f} {x} {y} {p}\n" for t, x, y, p in rows)
    yield Seed("text in seconds", {"a.csv": seconds.encode()}, "a.csv")
    yield Seed("UTF-16", {"a.csv": lines.encode("utf-16")}, "a.csv")


def archive_seeds(events: Events, folder: Path) -> Iterator[Seed]:
    """NumPy archives and folders, one of them with a pickle that would run."""
    rows = np.stack((events.t * 1e-6, events.x, events.y, events.p > 0), axis=1)
    matrix = np.array([[50.0, 0, 31], [0, 51, 23], [0, 0, 1]])
    depth = np.ones((2, *SIZE), np.float32)
    np.savez(folder / "a.npz", events=rows, K=matrix, D=np.zeros(4), depth=depth, meta=np.array(Payload(), object))
    np.savez_compressed(folder / "b.npz", events=rows, depth=depth)
    for name in ("a.npz", "b.npz"):
        yield Seed(f"EV-IMO {name}", {name: (folder / name).read_bytes()}, name)
    plain = folder / "evimo2"
    plain.mkdir()
    np.save(plain / "dataset_events_t.npy", events.t * 1e-6)
    np.save(plain / "dataset_events_xy.npy", np.stack((events.x, events.y), axis=1))
    np.save(plain / "dataset_events_p.npy", (events.p > 0).astype(np.uint8))
    np.savez(plain / "dataset_depth.npz", depth_0=depth[0])
    np.savez(plain / "dataset_info.npz", K=matrix, meta=np.array(Payload(), object))
    (plain / "dataset_info.json").write_text(
        json.dumps({"meta": {"fx": 50, "fy": 51, "cx": 31, "cy": 23, "res_x": 64, "res_y": 48}})
    )
    yield Seed("EVIMO2", {path.name: path.read_bytes() for path in plain.iterdir()}, "")
    yield Seed("a pickle", {"a.npy": pickle.dumps(Payload())}, "a.npy")


def binary_seeds(events: Events, folder: Path) -> Iterator[Seed]:
    """What we write ourselves."""
    for name in SAVE:
        path = folder / f"a.{name}"
        save_events([events], path, size=SIZE)
        yield Seed(f"written {name}", {path.name: path.read_bytes()}, path.name)


def calibration_seeds() -> Iterator[Seed]:
    """Calibrations in text, one of them with YAML that would run."""
    kalibr = "cam0:\n  camera_model: pinhole\n  intrinsics: [50, 51, 31, 23]\n  distortion_model: radtan\n"
    kalibr += "  distortion_coeffs: [-0.1, 0.01, 0, 0]\n  resolution: [64, 48]\n  rostopic: /events\n"
    ros = "image_width: 64\nimage_height: 48\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [50,0,31,0,51,23,0,0,1]\n"
    ros += "distortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0.1, 0, 0, 0, 0]\n"
    yield Seed("kalibr", {"a.yaml": kalibr.encode()}, "a.yaml", kind="calibration")
    yield Seed("camera_info", {"a.yaml": ros.encode()}, "a.yaml", kind="calibration")
    runs = f"cam0: !!python/object/apply:os.mkdir [{RAN}]\n{kalibr}"
    yield Seed("YAML that runs", {"a.yaml": runs.encode()}, "a.yaml", kind="calibration")
    yield Seed("nine numbers", {"calib.txt": b"50 51 31 23 -0.1 0.01 0 0 0"}, "calib.txt", kind="calibration")


def shared_seeds(shared: Path) -> Iterator[Seed]:
    """Heads of real recordings, and real calibrations."""
    recordings = shared / "formats"
    for path in sorted(path for path in recordings.rglob("*") if path.is_file() and path.suffix not in (".csv", "")):
        folder = path.parent
        if (folder / "metadata.yaml").exists():
            if path.name == "metadata.yaml":
                files = {each.name: each.read_bytes() for each in sorted(folder.iterdir())}
                yield Seed(f"shared {folder.name}", files, "")
            continue
        content = path.read_bytes()
        whole = len(content) <= 4 * HEAD or path.suffix == ".h5"
        yield Seed(f"shared {path.name}", {path.name: content if whole else content[:HEAD]}, path.name)
    kinds = {".yaml", ".yml", ".txt", ".json", ".xml"}
    for path in sorted(path for path in (shared / "calibration").rglob("*") if path.suffix in kinds):
        if path.stat().st_size <= HEAD:
            name = f"calibration {path.relative_to(shared)}"
            yield Seed(name, {path.name: path.read_bytes()}, path.name, kind="calibration")


def seeds(shared: Path | None, of: str = "") -> list[Seed]:
    """Everything that is damaged here, as far as its name holds the word `of`."""
    events = some_events()
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        found = [*text_seeds(events), *archive_seeds(events, folder), *binary_seeds(events, folder)]
    found += calibration_seeds()
    for name, (files, opened) in fuzz_predictions.whole().items():
        found.append(Seed(f"predictions {name}", files, opened, "predictions"))
    found += [Seed(f"truth {name}", *files) for name, files in fuzz_truth.whole().items()]
    found += [Seed(name, *files, "capture") for name, files in fuzz_truth.captures().items()]
    found += shared_seeds(shared) if shared and shared.exists() else []
    return [seed for seed in found if of in seed.name]
