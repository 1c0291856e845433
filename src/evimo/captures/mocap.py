"""Motion capture from its files: poses and markers of every body in bags, TUM texts and CSV."""

from array import array
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evimo.captures.tables import CSV, MARKER_CSV, PLACE, POSE, Rows, csv_rows, is_csv, tum_rows
from evimo.captures.tracks import MarkerPlaces, MarkerTracks, MocapTrack, markers_of, track_of
from evimo.errors import BadFile, NotFound
from evimo.formats.bag_bodies import BODY_KINDS, body_samples, body_topics, open_bag_of, stamps_to_events
from evimo.formats.bag_messages import Bag, Topic
from evimo.formats.recognition import STARTS
from evimo.formats.rosbag2 import is_folder_of_bag

Clock = Callable[[list[int]], list[int]]
MOCAP_FIX = f"a bag with {' or '.join(BODY_KINDS)}; or {CSV}; or a file for each body with lines `t x y z qx qy qz qw`"


def load_tracks(path: str | Path, *, in_clock_of: str | None = None) -> dict[str, MocapTrack]:
    """Load where motion capture saw each body, by the body's name.

    In a bag, bodies are named by the last words of their topics, or by whole topics where these words are the same;
    in CSV by the column `body`, and where there is none by the file, as in a text of TUM.

    Args:
        path: a bag of ROS 1 or ROS 2, a CSV, or a text in TUM's format.
        in_clock_of: the topic of events in the same bag whose clock the times are brought to, "" for the first one;
            None leaves them as they are stamped.

    Raises:
        NotFound: there is no such file. BadFile: it holds no poses, or a line or message is damaged.
    """
    path = Path(path)
    bag = _bag(path)
    if bag is not None:
        found = {
            name: _bag_track(name, bag, topic, _clock(bag, in_clock_of)) for name, topic in _named(body_topics(bag))
        }
    else:
        found = _text_tracks(path)
    if not found:
        raise BadFile(f"{path} holds no poses of motion capture", fix=MOCAP_FIX)
    return found


def load_markers(path: str | Path, *, in_clock_of: str | None = None) -> dict[str, MarkerTracks]:
    """Load where motion capture saw the markers of each body, by the body's name: from a bag, or a CSV of markers.

    A CSV has a line for each marker at each time, with empty x, y and z where it was not seen.

    Args:
        path: a bag, or a CSV with the columns t, body, marker, x, y, z.
        in_clock_of: as for `load_tracks`.

    Raises:
        NotFound: there is no such file. BadFile: it holds no markers, or a line or message is damaged.
    """
    path = Path(path)
    bag = _bag(path)
    if bag is None:
        found = _text_markers(path)
    else:
        tracks = (_bag_markers(name, bag, topic, _clock(bag, in_clock_of)) for name, topic in _named(body_topics(bag)))
        found = {track.body: track for track in tracks if track.names}
    if not found:
        raise BadFile(f"{path} holds no markers", fix=f"a bag with vicon/Subject, or {MARKER_CSV}")
    return found


def is_bag(path: Path) -> bool:
    """Whether a file or folder is a bag of ROS."""
    return _bag_kind(path) is not None


def _bag(path: Path) -> Bag | None:
    """The bag; None of a text.

    Raises:
        NotFound: there is no such file. BadFile: it is a folder, but no bag.
    """
    if not path.exists():
        raise NotFound(f"there is no file of motion capture {path}", fix=MOCAP_FIX)
    kind = _bag_kind(path)
    if kind is None and path.is_dir():
        raise BadFile(f"{path} is a folder, but no bag", fix=MOCAP_FIX)
    return None if kind is None else open_bag_of(path, ros2=kind == "rosbag2")


def _bag_kind(path: Path) -> str | None:
    if path.is_dir():
        return "rosbag2" if is_folder_of_bag(path) else None
    try:
        with path.open("rb") as file:
            start = file.read(16)
    except OSError:
        return None
    kinds = (kind for magic, kind in STARTS.items() if start.startswith(magic))
    kind = next(kinds, None)
    return kind if kind in ("rosbag1", "rosbag2") else None


def _clock(bag: Bag, topic: str | None) -> Clock:
    if topic is None:
        return lambda stamps_ns: [stamp_ns // 1000 for stamp_ns in stamps_ns]
    return lambda stamps_ns: stamps_to_events(bag, topic or None, stamps_ns)


def _named(found: list[Topic]) -> list[tuple[str, Topic]]:
    """Each body's name, the last word of its topic; the whole topic where others end in the same word."""
    last = [topic.name.rpartition("/")[2] for topic in found]
    return [
        (word if last.count(word) == 1 else topic.name.strip("/"), topic)
        for word, topic in zip(last, found, strict=True)
    ]


def _bag_track(body: str, bag: Bag, topic: Topic, clock: Clock) -> MocapTrack:
    stamps: list[int] = []
    numbers, tracked = array("d"), bytearray()  # the count that the bag tells may be wrong
    for sample in body_samples(bag, topic, markers=False):
        stamps.append(sample.stamp_ns)
        numbers.extend(sample.pose)
        tracked.append(sample.tracked)
    poses = np.array(numbers, np.float64).reshape(-1, 7)
    return track_of(
        body, np.array(clock(stamps), np.int64), poses, np.frombuffer(tracked, np.bool_), where=str(bag.path)
    )


def _bag_markers(body: str, bag: Bag, topic: Topic, clock: Clock) -> MarkerTracks:
    stamps: list[int] = []
    columns: dict[str, int] = {}
    instants, markers, numbers, seen = array("q"), array("q"), array("d"), bytearray()
    for number, sample in enumerate(body_samples(bag, topic, markers=True)):
        stamps.append(sample.stamp_ns)
        for marker in sample.markers:
            instants.append(number)
            markers.append(columns.setdefault(marker.name, len(columns)))
            numbers.extend(marker.position)
            seen.append(marker.visible)
    places = MarkerPlaces(
        np.array(instants, np.intp),
        np.array(markers, np.intp),
        np.array(numbers, np.float64).reshape(-1, 3),
        np.frombuffer(seen, np.bool_),
    )
    return markers_of(body, np.array(clock(stamps), np.int64), tuple(columns), places, where=str(bag.path))


def _text_tracks(path: Path) -> dict[str, MocapTrack]:
    pieces: dict[str, list[tuple[NDArray[np.int64], NDArray[np.float64]]]] = {}
    for rows in _pose_rows(path):
        for body, mine in _by_body(rows, path.stem):
            pieces.setdefault(body, []).append((rows.times_us[mine], rows.numbers[mine]))
    found: dict[str, MocapTrack] = {}
    for body in list(pieces):
        times_us, numbers = map(np.concatenate, zip(*pieces.pop(body), strict=True))
        tracked = numbers[:, 7] != 0 if numbers.shape[1] > 7 else np.ones(len(times_us), np.bool_)
        found[body] = track_of(body, times_us, numbers[:, :7], tracked, where=str(path))
    return found


def _pose_rows(path: Path) -> Iterator[Rows]:
    if is_csv(path):
        return csv_rows(path, (*POSE, "[tracked]"), ("[body]",), form=CSV)
    return tum_rows(path)


def _by_body(rows: Rows, default: str) -> Iterator[tuple[str, NDArray[np.intp]]]:
    """Each body's name, and which rows are its."""
    if not rows.words:
        yield default, np.arange(len(rows.times_us))
        return
    names: dict[str, int] = {}
    index = _numbered(rows.words[0], names)
    for name, number in names.items():
        yield name or default, np.flatnonzero(index == number)


def _numbered(words: Sequence[str], numbers: dict[str, int]) -> NDArray[np.intp]:
    """The number of each word, where new ones get the next: an array of words would be as wide as the longest."""
    return np.fromiter((numbers.setdefault(word, len(numbers)) for word in words), np.intp, len(words))


def _text_markers(path: Path) -> dict[str, MarkerTracks]:
    pieces: dict[str, list[tuple[NDArray[np.int64], NDArray[np.intp], NDArray[np.float64]]]] = {}
    columns: dict[str, dict[str, int]] = {}
    for rows in csv_rows(path, PLACE, ("[body]", "marker"), form=MARKER_CSV):
        for body, mine in _by_body(rows, path.stem):
            markers = _numbered([rows.words[1][at] for at in mine.tolist()], columns.setdefault(body, {}))
            pieces.setdefault(body, []).append((rows.times_us[mine], markers, rows.numbers[mine]))
    found: dict[str, MarkerTracks] = {}
    for body, parts in pieces.items():
        times_us, markers, places = (np.concatenate(each) for each in zip(*parts, strict=True))
        everywhere = MarkerPlaces(np.arange(len(times_us)), markers, places, np.ones(len(times_us), np.bool_))
        found[body] = markers_of(body, times_us, tuple(columns[body]), everywhere, where=str(path))
    return found
