"""Which files hold the predictions of a recording, and which reader is theirs."""

import zipfile
from collections.abc import Sequence
from pathlib import Path

from evimo.errors import BadFile, BadInput, NotFound
from evimo.formats.npz_members import Archive
from evimo.predictions.archives import holds_maps, open_archive
from evimo.predictions.event_labels import found_labels
from evimo.predictions.label_files import LabelFile, labels_in_csv, labels_in_h5, labels_in_npz
from evimo.predictions.pictures import holds_pictures, open_pictures
from evimo.predictions.runs import ESTIMATES, EVENTS, open_estimates, opened_h5, sound
from evimo.predictions.sources import Predictions
from evimo.recordings.recording import Recording

SUFFIXES = (".npz", ".h5", ".csv", ".txt")
KINDS = (
    "estimates.h5 or the folder of a run, a folder of PNG masks, an npz with masks or ids and times, or labels of"
    " events as CSV or npz"
)


def open_predictions(path: Path, recording: Recording) -> Predictions:
    """Open what a program says of a recording, whatever of the known kinds it is.

    Raises:
        NotFound: nothing is there. BadFile: it is of no known kind, or damaged. BadInput: of another sensor.
    """
    if not path.exists():
        raise NotFound(f"no predictions {str(path)!r}", fix=KINDS)
    if path.is_dir():
        return _open_folder(path, recording)
    if not path.is_file():
        raise BadFile(f"{path} is a pipe or a device", fix="save it as a file first")
    suffix = path.suffix.lower()
    if suffix == ".h5":
        with opened_h5(path) as file, sound(path):
            of_events = "object" in file
        return _labelled(labels_in_h5(path), recording) if of_events else open_estimates(path, recording.camera.size)
    if zipfile.is_zipfile(path) or suffix == ".npz":
        archive = Archive(path)
        if holds_maps(archive):
            return open_archive(archive, recording.camera.size)
        return _labelled(labels_in_npz(archive), recording)
    if suffix in (".csv", ".txt"):
        return _labelled(labels_in_csv(path), recording)
    raise BadFile(f"{path} is no kind of predictions", fix=KINDS)


def predictions_of(path: Path, recordings: Sequence[Path]) -> list[Path]:
    """Which predictions are of which recordings: of one all of them, of several those that are named like each.

    Folder `a/b` or file `a/b.npz` is of recording `…/a/b`, or else `b` or `b.npz` is.

    Raises:
        NotFound: there is nothing at all. BadInput: a recording has none, or two have the same.
    """
    if not path.exists():
        raise NotFound(f"no predictions {str(path)!r}", fix=KINDS)
    found = [_named_like(path, recording) for recording in recordings]
    if len(recordings) == 1:
        return [found[0] or path]
    for recording, prediction in zip(recordings, found, strict=True):
        if prediction is None:
            raise BadInput(
                f"{path} holds no predictions of {recording}",
                fix=f"with several recordings, a folder or file for each: {path / recording.name}",
            )
    paths = [prediction for prediction in found if prediction is not None]
    if twice := next((each for each in paths if paths.count(each) > 1), None):
        raise BadInput(f"{twice} could be of several of the recordings", fix="folders that are named like theirs, too")
    return paths


def _named_like(path: Path, recording: Path) -> Path | None:
    """What lies below `path` under the recording's name, and under the most of the names of its folders."""
    parts = recording.resolve().with_suffix("").parts if recording.is_file() else recording.resolve().parts
    for first in range(1, len(parts)):
        place = path.joinpath(*parts[first:])
        for candidate in (place, *(place.with_name(place.name + suffix) for suffix in SUFFIXES)):
            if candidate.exists():
                return candidate
    return None


def _open_folder(folder: Path, recording: Recording) -> Predictions:
    """The outputs of a run, or pictures."""
    estimates, events = folder / ESTIMATES, folder / EVENTS
    labels = _labelled(labels_in_h5(events), recording) if events.is_file() else None
    if estimates.is_file():
        maps = open_estimates(estimates, recording.camera.size)
        if labels is None:
            return maps
        if labels.facts != maps.facts:
            raise BadFile(f"{ESTIMATES} and {EVENTS} in {folder} are of different models", fix=f"give {estimates}")
        kind = f"{maps.kind}, {labels.kind}"
        return Predictions(path=folder, kind=kind, maps=maps.maps, labels=labels.labels, facts=maps.facts)
    if labels is not None:
        return labels
    if holds_pictures(folder):
        return open_pictures(folder, recording.camera.size)
    raise BadFile(f"{folder} holds no predictions", fix=KINDS)


def _labelled(file: LabelFile, recording: Recording) -> Predictions:
    labels = found_labels(file, recording.events, recording.event_count())
    return Predictions(path=file.path, kind=file.kind, labels=labels, facts=file.facts)
