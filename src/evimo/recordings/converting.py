"""A recording with truth written again in another layout, in constant memory."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadFile
from evimo.events.events import Events, joined, no_events
from evimo.jobs.crew import ALONE, Crew
from evimo.jobs.finishing import finished
from evimo.recordings.facts import own_version
from evimo.recordings.pose_track import PoseTrack
from evimo.recordings.recording import Recording, open_recording
from evimo.recordings.writers import Target, writer_of


def convert_recordings(
    targets: Mapping[Path, Path],
    layout: Target,
    out: Path,
    *,
    crew: Crew = ALONE,
    progress: Callable[[float], object] = lambda share: None,
) -> Iterator[Path]:
    """Write the recordings that do not exist yet in a layout, and yield the path of each when it is complete.

    Args:
        targets: where each recording goes.
        layout: as for `convert_recording`.
        out: folder that the targets are in.
        crew: who converts; each a whole recording.
        progress: is called with the share of a recording that is done: after each instant where this process works,
            else after each recording.

    Raises:
        NotFound, BadFile: a recording is damaged, or does not fit the layout; comes after all others.
        BadInput: it cannot be written.
    """
    missing = [pair for pair in targets.items() if not pair[1].exists()]
    work = partial(_convert, layout, progress if crew.is_alone else None)
    for path in finished(work, missing, crew=crew, shared=out, name=lambda pair: pair[0]):
        if not crew.is_alone:
            progress(1)
        yield path


def _convert(layout: Target, told: Callable[[float], object] | None, pair: tuple[Path, Path]) -> Path:
    """One of them, unless it is there."""
    path, target = pair
    if not target.exists():
        recording = open_recording(path)
        share = 1 / max(1, len(recording))
        convert_recording(recording, target, layout, progress=lambda: told and told(share))
    return target


def convert_recording(
    recording: Recording, path: Path, layout: Target, *, progress: Callable[[], object] = lambda: None
) -> Path:
    """Write a recording in a layout of this package; events, maps, motions and poses stay what they are.

    What EV-IMO and EVIMO2 leave to be derived, motions and which objects move, is written as it was derived. The
    result holds no pickle, and opens in a fraction of the time.

    Args:
        recording: any that `open_recording` opens.
        path: to make; must not exist yet.
        layout: `evimo2` (a folder that is memory-mapped), `evimo1` (.npz), or `hdf5` (in chunks).
        progress: is called after each instant of truth.

    Raises:
        BadFile: the recording is damaged, or the layout cannot hold it. BadInput: it cannot be written.
    """
    if not len(recording) or recording.meta.get("layout") == "EV-IMO bag":
        raise BadFile(f"{recording.path} has no maps of truth", fix="`evimo annotate` makes them of a bag and scans")
    poses = _poses(recording)
    facts = {"converted_from": recording.path.name, "version": own_version(), **recording.meta}
    facts = {key: value for key, value in facts.items() if key not in ("camera", "format")}
    if poses is None and layout == "evimo1":
        raise BadFile(f"{recording.path} holds no poses, which the layout evimo1 needs", fix="evimo2 or hdf5")
    with writer_of(layout, path, recording.camera, poses=poses, facts=facts, imu=recording.imu) as writer:
        for k, (events, ids) in enumerate(_pieces(recording)):
            writer.write(events, recording.truth(k), clutter_bodies=recording.clutter_bodies(k), event_ids=ids)
            progress()
    return path


def _poses(recording: Recording) -> Callable[[NDArray[np.int64]], PoseTrack] | None:
    """Where everything is at any time; beyond the ends of the paths where it was there."""
    paths = recording.paths
    if paths is None or not len(paths.camera.starts_us):
        return None
    first, last = int(paths.camera.starts_us[0]), int(paths.camera.stops_us[-1])

    def at(times_us: NDArray[np.int64]) -> PoseTrack:
        found = paths.poses(np.clip(times_us, first, last))
        return PoseTrack(np.asarray(times_us, np.int64), *(getattr(found, name) for name in POSES))

    return at


POSES = ("world_from_cam", "object_ids", "cam_from_object")


def _pieces(recording: Recording) -> Iterator[tuple[Events, NDArray[np.uint8] | None]]:
    """All events in as many pieces as there are instants, each with its events' ids where they are known.

    A piece reaches from the middle between two instants to the next; the first and last take what is beyond.
    """
    times = recording.times_us
    stops = [*((times[1:] + times[:-1]) // 2).tolist(), np.iinfo(np.int64).max]
    ids, first, waiting = recording.event_ids, 0, list[Events]()
    packets = recording.events.packets()
    packet = next(packets, None)
    for stop in stops:
        while packet is not None and packet.t[-1] < stop:
            waiting.append(packet)
            packet = next(packets, None)
        if packet is not None:
            cut = int(np.searchsorted(packet.t, stop))
            waiting.append(Events(packet.x[:cut], packet.y[:cut], packet.t[:cut], packet.p[:cut]))
            packet = Events(packet.x[cut:], packet.y[cut:], packet.t[cut:], packet.p[cut:])
        piece = joined(waiting) if waiting else no_events()
        last, waiting = first + len(piece), []
        yield piece, ids[first:last] if ids is not None else None
        first = last
