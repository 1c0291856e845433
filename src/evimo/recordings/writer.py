"""Write a recording with truth as an EVIMO2v2 folder, slice by slice, in constant memory; nothing is pickled."""

import json
import shutil
import zipfile
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadInput
from evimo.events.events import Events
from evimo.geometry.camera import Camera
from evimo.recordings.truth import Truth

ARRAYS = {"t": ("<f8", 1), "xy": ("<u2", 2), "p": ("|u1", 1)}
MAPS = ("depth", "mask", "clutter")
FORMAT = 1
COMPRESSION = 4
ZIP_DATE = (1980, 1, 1, 0, 0, 0)  # not the clock's: the same recording gives the same bytes


class RecordingWriter:
    """Writes beside the target and moves the finished folder there, so that a folder that exists is complete.

    Use as a context manager; an exception inside leaves nothing behind.

    Args:
        folder: to make; must not exist yet.
        camera: of the sensor. facts: plain numbers and words for the JSON, how it was made.
    """

    def __init__(self, folder: Path, camera: Camera, *, facts: dict[str, Any] | None = None) -> None:
        if folder.exists():
            raise BadInput(f"{folder} exists", fix="another name, or remove it")
        self.folder, self.camera, self.facts = folder, camera, facts or {}
        self.unfinished = folder.with_name(f".{folder.name}.unfinished")
        self.truths: list[Truth] = []
        self.events = 0

    def __enter__(self) -> "RecordingWriter":
        shutil.rmtree(self.unfinished, ignore_errors=True)
        self.unfinished.mkdir(parents=True)
        self._arrays = {name: self._begun(name) for name in ARRAYS}
        self._maps = {name: zipfile.ZipFile(self._file(f"{name}.npz"), "w", zipfile.ZIP_DEFLATED) for name in MAPS}
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for name, file in self._arrays.items():
            file.seek(0)
            _write_header(file, name, self.events)
            file.close()
        for archive in self._maps.values():
            archive.close()
        if error is None:
            self._write_facts()
            self.unfinished.rename(self.folder)
        else:
            shutil.rmtree(self.unfinished, ignore_errors=True)

    def write(self, events: Events, truth: Truth, *, clutter_bodies: NDArray[np.uint8] | None = None) -> None:
        """Append the events of one slice and the truth of one instant; `clutter_bodies` (H, W) numbers them."""
        self.events += len(events)
        self._arrays["t"].write((events.t * 1e-6).astype("<f8").tobytes())
        self._arrays["xy"].write(np.stack((events.x, events.y), axis=1).astype("<u2").tobytes())
        self._arrays["p"].write((events.p > 0).astype("|u1").tobytes())
        depth = np.where(truth.valid, np.rint(truth.depth * 1000), 0).clip(0, 65535).astype(np.uint16)
        bodies = truth.clutter.astype(np.uint8) if clutter_bodies is None else clutter_bodies
        for name, values in (("depth", depth), ("mask", truth.ids.astype(np.uint16) * 1000), ("clutter", bodies)):
            member = zipfile.ZipInfo(f"{name}_{len(self.truths):010d}.npy", ZIP_DATE)
            member.compress_type = zipfile.ZIP_DEFLATED
            with self._maps[name].open(member, "w") as file:
                np.lib.format.write_array(file, values, allow_pickle=False)
        nothing = np.zeros((0, 0))
        self.truths.append(Truth(truth.t_us, nothing, nothing, nothing, nothing, truth.ego, truth.objects))  # type: ignore[arg-type]

    def _begun(self, name: str) -> BinaryIO:
        file = self._file(f"events_{name}.npy").open("wb")
        _write_header(file, name, 0)
        return file

    def _file(self, name: str) -> Path:
        return self.unfinished / f"dataset_{name}"

    def _write_facts(self) -> None:
        times = np.array([truth.t_us for truth in self.truths], np.int64)
        ids = sorted({id_ for truth in self.truths for id_ in truth.objects})
        motions = np.full((3, len(times), len(ids), 3), np.nan)
        for frame, truth in enumerate(self.truths):
            for id_, moved in truth.objects.items():
                motions[:, frame, ids.index(id_)] = moved.position, moved.velocity, moved.rotation
        ego = np.array([truth.ego for truth in self.truths]).reshape(-1, 6)
        sim = {"times_us": times, "ego": ego, "object_ids": np.array(ids, np.uint8)}
        sim |= dict(zip(("positions", "velocities", "rotations"), motions, strict=True))
        _save_arrays(self._file("sim.npz"), sim)
        self._file("info.json").write_text(json.dumps(self._information(times), indent=1))

    def _information(self, times: NDArray[np.int64]) -> dict[str, Any]:
        lens = self.camera
        names = ("k1", "k2", "p1", "p2", "k3") if lens.lens == "radtan" else ("k1", "k2", "k3", "k4")
        intrinsics = {name: 0.0 for name in ("k1", "k2", "k3", "k4", "p1", "p2")}
        intrinsics |= dict(zip(names, lens.distortion, strict=False))
        meta = {"fx": lens.fx, "fy": lens.fy, "cx": lens.cx, "cy": lens.cy, **intrinsics}
        meta |= {"dist_model": "radtan" if lens.lens == "radtan" else "equidistant"}
        meta |= {"res_x": lens.width, "res_y": lens.height, "ros_time_offset": 0.0}
        frames = [{"id": k, "ts": t * 1e-6} for k, t in enumerate(times.tolist())]
        facts = {"format": FORMAT, "camera": asdict(lens), **self.facts}
        return {"evimo": facts, "meta": {"meta": meta, "frames": frames}}


def _write_header(file: BinaryIO, name: str, rows: int) -> None:
    """NumPy pads headers so that the first axis can grow in place."""
    kind, columns = ARRAYS[name]
    shape = (rows,) if columns == 1 else (rows, columns)
    header = {"descr": kind, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(file, header)


def _save_arrays(path: Path, arrays: dict[str, NDArray[Any]]) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, values in arrays.items():
            with archive.open(zipfile.ZipInfo(f"{name}.npy", ZIP_DATE), "w") as file:
                np.lib.format.write_array(file, values, allow_pickle=False)
