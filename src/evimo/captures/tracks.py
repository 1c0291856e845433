"""What motion capture gives: where each body was, and where its markers were."""

import warnings
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from evimo.errors import BadFile, EvimoWarning
from evimo.geometry.pose_samples import restart_of

F8 = NDArray[np.float64]

MOST_CELLS, SPARSEST = 1_000_000, 20  # instants times markers; more only with a sighting for every twenty of them


@dataclass(frozen=True, slots=True)
class MocapTrack:
    """Where motion capture saw one body, about 200 times per second.

    body:     its name.
    times_us: (M,) int64, rising.
    position: (M, 3) of its origin in the world, m.
    turn:     (M, 3) rotation vectors of world_from_body, rad: an hour of matrices would take three times the memory.
    tracked:  (M,) bool; where it is false, position and turn mean nothing.
    """

    body: str
    times_us: NDArray[np.int64]
    position: F8
    turn: F8
    tracked: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.times_us)

    @property
    def world_from_body(self) -> F8:
        """The poses as matrices (M, 4, 4)."""
        matrices = np.tile(np.eye(4), (len(self), 1, 1))
        matrices[:, :3, :3] = Rotation.from_rotvec(self.turn).as_matrix()
        matrices[:, :3, 3] = self.position
        return matrices

    def picked(self, index: NDArray[np.intp]) -> "MocapTrack":
        """Some of the samples."""
        return MocapTrack(self.body, self.times_us[index], self.position[index], self.turn[index], self.tracked[index])

    def shifted(self, offset_us: int) -> "MocapTrack":
        """The same in a clock that shows offset_us more."""
        return replace(self, times_us=self.times_us + offset_us)


@dataclass(frozen=True, slots=True)
class MarkerTracks:
    """Where motion capture saw the markers of one body.

    names:    (K) of the markers.
    times_us: (M,) int64, rising.
    position: (M, K, 3) in the world, m.
    visible:  (M, K) bool; where it is false, the position means nothing.
    """

    body: str
    names: tuple[str, ...]
    times_us: NDArray[np.int64]
    position: F8
    visible: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.times_us)

    def shifted(self, offset_us: int) -> "MarkerTracks":
        """The same in a clock that shows offset_us more."""
        return replace(self, times_us=self.times_us + offset_us)


class MarkerPlaces(NamedTuple):
    """Sightings of markers, N of them.

    instant:  (N,) index of the instant. marker: (N,) index of the name.
    position: (N, 3) in the world, m. visible: (N,) whether it was seen.
    """

    instant: NDArray[np.intp]
    marker: NDArray[np.intp]
    position: F8
    visible: NDArray[np.bool_]


def track_of(
    body: str, times_us: NDArray[np.int64], poses: F8, tracked: NDArray[np.bool_], *, where: str = "motion capture"
) -> MocapTrack:
    """The track of samples as they are stored: sorted, of equal times the first, in rotation vectors.

    where: they come from, for errors.
    poses: (M, 7) x y z in m and quaternion x y z w. Samples that are not finite, or whose quaternion is of no length,
        count as not tracked: many programs write zeros where they see nothing.

    Raises:
        BadFile: the clock starts again before half of the samples.
    """
    if not (np.diff(times_us) > 0).all():
        times_us = times_us[: _until_restart(f"{where}, body {body!r}", times_us)]
        times_us, rows = np.unique(times_us, return_index=True)
        poses, tracked = poses[rows], tracked[rows]
    length = np.linalg.norm(poses[:, 3:], axis=1)
    known = tracked & np.isfinite(poses).all(axis=1) & (np.abs(length - 1) < 0.01)
    quaternion = np.where(known[:, None], poses[:, 3:], (0, 0, 0, 1))
    position = np.where(known[:, None], poses[:, :3], 0)
    return MocapTrack(body, times_us, position, Rotation.from_quat(quaternion).as_rotvec(), known)


def markers_of(
    body: str, times_us: NDArray[np.int64], names: tuple[str, ...], places: MarkerPlaces, *, where: str
) -> MarkerTracks:
    """The tracks of markers given one by one.

    Args:
        body: whose they are.
        times_us: of the instants, in any order.
        names: of the markers.
        places: of any of them at any instant, in any order.
        where: they come from, for errors.

    Raises:
        BadFile: hardly any marker is there at hardly any instant, as where each sighting got a name of its own; or the
            clock starts again before half of the sightings.
    """
    places = _before_restart(f"{where}, markers of body {body!r}", times_us, places)
    order, row = np.unique(times_us, return_inverse=True)
    if len(order) * len(names) > MOST_CELLS + SPARSEST * len(places.marker):
        text = f"markers of body {body!r} have {len(names):,} names, most of them at few of {len(order):,} instants"
        raise BadFile(f"{where}: {text}", fix="a file whose markers are labelled, without those that are not")
    position = np.zeros((len(order), len(names), 3))
    visible = np.zeros(position.shape[:2], np.bool_)
    at = row[places.instant], places.marker
    seen = places.visible & np.isfinite(places.position).all(axis=1)
    position[at], visible[at] = np.where(seen[:, None], places.position, 0), seen
    return MarkerTracks(body, names, order, position, visible)


def _before_restart(what: str, times_us: NDArray[np.int64], places: MarkerPlaces) -> MarkerPlaces:
    """Sightings of markers without those after the clock starts again: of each marker, in the order of the file."""
    stamps_us, kept = times_us[places.instant], np.ones(len(places.marker), np.bool_)
    if (np.diff(stamps_us) >= 0).all():
        return places
    order = np.argsort(places.marker, kind="stable")  # a file may have one marker after another
    for mine in np.split(order, np.flatnonzero(np.diff(places.marker[order])) + 1):
        kept[mine[restart_of(stamps_us[mine]) :]] = False
    if not kept.all():
        _say_restart(what, kept, int(stamps_us[kept].max()))
    return MarkerPlaces(places.instant[kept], places.marker[kept], places.position[kept], places.visible[kept])


def _until_restart(what: str, times_us: NDArray[np.int64]) -> int:
    """How many samples there are until the clock starts again."""
    at = restart_of(times_us)
    if at < len(times_us):
        _say_restart(what, np.arange(len(times_us)) < at, int(times_us[at - 1]))
    return at


def _say_restart(what: str, kept: NDArray[np.bool_], last_us: int) -> None:
    """Say, as of events, what is dropped after a clock started again; most of a file is not.

    Raises:
        BadFile: it would be more than half.
    """
    lost, text = int(np.count_nonzero(~kept)), f"{what}: the clock of motion capture starts again after {last_us} µs"
    if 2 * lost > len(kept):
        raise BadFile(f"{text}, with {lost:,} of {len(kept):,} samples", fix="split the file where it does")
    text = f"{text}: the {lost:,} samples from there on were dropped (split the file there to read them)"
    warnings.warn(text, EvimoWarning, stacklevel=5)
