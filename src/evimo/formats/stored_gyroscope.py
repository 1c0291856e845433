"""Gyroscopes in recordings of our own simulator, and in EVIMO2 folders whose pickle was written again as JSON."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from evimo.errors import BadFile
from evimo.events.gyroscope import Gyroscope, gyroscope_of
from evimo.formats.npz_members import Archive


def simulated_gyroscope(archive: Archive, prefix: str) -> Gyroscope | None:
    """The arrays `t_us` and `gyro` as `evimo simulate` writes them, in camera axes; None where there are none.

    Raises:
        BadFile: they are damaged or do not fit together.
    """
    names = [f"{prefix}t_us", f"{prefix}gyro"]
    if not archive.names.issuperset(names):
        return None
    t_us, rate = (archive.whole(name) for name in names)
    if t_us.dtype.kind not in "iu" or t_us.ndim != 1 or rate.dtype.kind != "f" or rate.shape != (len(t_us), 3):
        raise BadFile(f"IMU arrays of {archive.path} do not fit together", fix="simulate it again")
    return gyroscope_of(t_us, rate, in_camera_axes=True, source=f"{archive.path.name}, simulated")


def folder_gyroscope(folder: Path) -> Gyroscope | None:
    """The gyroscope of an EVIMO2 folder: from `dataset_imu.npz`, else from `imu` in `dataset_info.json`.

    EVIMO2 stores a list of samples for each topic, in the sensor's own axes; the first topic by name is read.

    Raises:
        BadFile: it is damaged.
    """
    if (path := folder / "dataset_imu.npz").exists():
        return simulated_gyroscope(Archive(path), "")
    if not (path := folder / "dataset_info.json").exists():
        return None
    try:
        stored: dict[str, Any] = json.loads(path.read_text())
        topics: dict[str, list[Any]] = stored.get("imu") or stored.get("meta", {}).get("imu") or {}
        if not topics:
            return None
        topic = min(topics)
        rows = [[sample["ts"], *(sample["angular_velocity"][axis] for axis in "xyz")] for sample in topics[topic]]
        values = np.array(rows, np.float64).reshape(-1, 4)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise BadFile(f"`imu` in {path} is not as EVIMO2 has it", fix="write the recording again") from error
    t_us = np.rint(values[:, 0] * 1e6).astype(np.int64)
    return gyroscope_of(t_us, values[:, 1:], in_camera_axes=False, source=f"{topic} in {path.name}")
