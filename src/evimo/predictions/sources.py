"""What every reader of predictions gives, slice by slice in constant memory."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile, BadInput
from evimo.events.slices import Slice
from evimo.recordings.prediction import Prediction


class Maps(Protocol):
    """Maps at instants, to be asked for in their order; times_us (N,) int64 ascend."""

    times_us: NDArray[np.int64]

    def at(self, k: int) -> Prediction:
        """What is said of the instant times_us[k].

        Raises:
            BadFile: it is damaged. BadInput: it is of another sensor.
        """
        ...


class Labels(Protocol):
    """An object for each event, to be asked for slice by slice, every slice in its order.

    unlabelled: how many events of the slices asked for so far have no label; they count as static.
    """

    unlabelled: int

    def of(self, part: Slice) -> NDArray[np.int64] | None:
        """The object of each event of a slice, 0 is static; None where no event of it has one, though it has events.

        Raises:
            BadFile: the labels are damaged. BadInput: they are not of this recording.
        """
        ...

    def finish(self) -> None:
        """After the last slice.

        Raises:
            BadInput: there are labels of events that the recording does not have.
        """
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Predictions:
    """What a program says of one recording: maps, labels of events, or both.

    kind:  in words, for the report.
    facts: the model's name and hash, as far as the file tells them.
    """

    path: Path
    kind: str
    maps: Maps | None = None
    labels: Labels | None = None
    facts: Mapping[str, str] = field(default_factory=dict[str, str])


def ascending_us(times: NDArray[Any], path: Path, *, name: str = "times") -> NDArray[np.int64]:
    """Return times as whole µs: whole numbers are µs, as is anything called `…_us`; fractions are seconds.

    Raises:
        BadFile: they are no times, none, or do not ascend.
    """
    if times.ndim != 1 or times.dtype.kind not in "iuf" or not np.isfinite(times).all():
        raise BadFile(f"`{name}` of {path} are {times.shape} {times.dtype}, no times", fix="one number for each mask")
    in_seconds = times.dtype.kind == "f" and not name.endswith("_us")
    found = np.rint(times * 1e6 if in_seconds else times).astype(np.int64)
    if not len(found):
        raise BadFile(f"{path} holds no prediction", fix="one mask for each slice of 25 ms")
    if (np.diff(found) <= 0).any():
        k = int(np.argmax(np.diff(found) <= 0))
        raise BadFile(
            f"times of {path} do not ascend: {found[k]} µs, then {found[k + 1]} µs",
            fix="sort the masks by time, one for each time; whole numbers are µs, fractions are seconds",
        )
    return found


def check_size(found: tuple[int, ...], sensor: tuple[int, int], what: str) -> None:
    """Refuse maps of another sensor.

    Raises:
        BadInput: the sizes (height, width) differ.
    """
    if found != sensor:
        found_px, sensor_px = (" x ".join(map(str, size)) for size in (found, sensor))
        raise BadInput(
            f"{what} is {found_px} (height x width), the recording's sensor {sensor_px}",
            fix="predictions in sensor pixels, neither cropped nor resized, of this very recording",
        )
