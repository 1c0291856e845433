"""What is wrong with a recording: its events, its clock, its poses, its camera, and how masks and events agree."""

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from evimo.errors import EvimoError, EvimoWarning
from evimo.formats.event_file import EventFile
from evimo.recordings.alignment_check import alignment_of
from evimo.recordings.datasets import dataset_layout, open_dataset
from evimo.recordings.layouts import found_layout
from evimo.recordings.recording import Recording, open_recording

GAP_US = 10_000  # without an event in a recording that is not quiet
QUIET = 50  # mean intervals: a gap is longer than so many
ON_SHARE = (0.2, 0.8)  # of events that are brighter, in any real scene
TIME_CORRELATION = 0.3  # of polarity with time: EVIMO2's first files hold a polarity that was made from times
FRAME_GAP = 1.6  # median steps between frames
MISALIGNED_MS = 2.0


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at. defect: whether it is wrong."""

    about: str
    words: str
    defect: bool


def findings(path: Path, events: EventFile) -> Iterator[Finding]:
    """Look at everything that a recording holds; what is damaged is a finding too.

    Args:
        path: of the recording. events: its events, opened.
    """
    yield from _event_findings(events)
    try:
        layout = found_layout(path)
        if layout is None:
            yield Finding("truth", "none is stored with the events", defect=False)
            return
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always", EvimoWarning)
            recording = open_recording(path)
        for warning in said:
            if issubclass(warning.category, EvimoWarning) and "left out" in str(warning.message):
                yield Finding("frames", str(warning.message), defect=True)
        yield from _truth_findings(recording)
        if layout != "EV-IMO bag":
            yield from _principal_findings(path)
            yield _alignment(recording)
    except EvimoError as error:
        yield Finding("truth", str(error.problem), defect=True)


def _event_findings(events: EventFile) -> Iterator[Finding]:
    """Of one pass over the events: gaps, order, polarity."""
    count, on, last_us = 0, 0, None
    sums = np.zeros(3)  # of time, its square, and its product with polarity
    gaps: list[tuple[int, int]] = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", EvimoWarning)
        for packet in events.packets():
            t = packet.t if last_us is None else np.append(last_us, packet.t)
            wide = np.flatnonzero(np.diff(t) > GAP_US)
            gaps += [(int(t[at]), int(t[at + 1])) for at in wide]
            since_s, bright = (packet.t - events.start_us) * 1e-6, packet.p > 0
            sums += (since_s.sum(), (since_s**2).sum(), since_s[bright].sum())
            count, on, last_us = count + len(packet), on + int(bright.sum()), int(packet.t[-1])
    mean_us = (events.stop_us - events.start_us) / max(count, 1)
    gaps = [gap for gap in gaps if gap[1] - gap[0] > QUIET * mean_us]
    yield Finding("events", f"{count:,} in {(events.stop_us - events.start_us) * 1e-6:.3f} s", defect=not count)
    yield _gaps("event gaps", gaps)
    faults = events.faults.parts(events.sensor)
    yield Finding("event order", "; ".join(faults) or "sorted, and all on the sensor", defect=bool(faults))
    share = on / max(count, 1)
    deviation = np.sqrt(
        max(sums[1] / max(count, 1) - (sums[0] / max(count, 1)) ** 2, 1e-12) * max(share - share**2, 1e-12)
    )
    correlation = float((sums[2] / max(count, 1) - share * sums[0] / max(count, 1)) / deviation) if count else 0.0
    wrong = not ON_SHARE[0] < share < ON_SHARE[1] or abs(correlation) > TIME_CORRELATION
    text = f"{share:.1%} brighter, correlation with time {correlation:+.2f}"
    if wrong:
        text += ": not a camera's; EVIMO2 files of before 24 May 2022 hold such"
    yield Finding("polarity", text, defect=wrong)


def _truth_findings(recording: Recording) -> Iterator[Finding]:
    """Of times and poses."""
    times = recording.times_us
    steps = np.diff(times)
    usual = float(np.median(steps)) if len(steps) else 0.0
    wide = np.flatnonzero(steps > FRAME_GAP * usual)
    rate = f", every {usual * 1e-3:.1f} ms" if usual else ""
    yield Finding("frames", f"{len(times):,} with truth{rate}", defect=not len(times))
    yield _gaps("frame gaps", [(int(times[at]), int(times[at + 1])) for at in wide])
    paths = recording.paths
    if paths is None:
        yield Finding("poses", "none are stored", defect=False)
        return
    bad = paths.bad_samples()
    listed = ", ".join(f"{number:,} of {name}" for name, number in bad.items())
    yield Finding("bad poses", listed or "none", defect=bool(bad))
    for name, path in {
        "camera": paths.camera,
        **{f"object {key}": paths.objects[key] for key in paths.object_ids},
    }.items():
        breaks = list(zip(path.stops_us[:-1].tolist(), path.starts_us[1:].tolist(), strict=True))
        if breaks or not len(path.starts_us):
            gaps = _gaps(f"{name} lost", breaks) if breaks else Finding(f"{name} lost", "all the time", defect=True)
            yield gaps
    moving = [key for key in paths.object_ids if paths.moving[key].any()]
    resting = [key for key in paths.object_ids if key not in moving]
    words = f"{', '.join(map(str, moving)) or 'none'} move; {', '.join(map(str, resting)) or 'none'} rest throughout"
    yield Finding("objects", words, defect=False)


def _principal_findings(path: Path) -> Iterator[Finding]:
    """Of the principal point, where maps and poses of a dataset tell it."""
    layout = dataset_layout(path)
    if layout is None or found_layout(path) != layout:  # what this package wrote has its own facts, and no such faults
        return
    dataset = open_dataset(path, layout)
    side = "left of and above" if dataset.first_version else "right of and below"
    text = f"maps show what is half a pixel {side} it, as their renderer cut coordinates off; kept as they are"
    yield Finding("half a pixel", text, defect=False)
    test = dataset.test()
    if not test.points:
        yield Finding("principal point", "no object turns enough to tell it", defect=False)
        return
    shares = ", ".join(f"{name} {share:.1%}" for name, share in test.shares.items())
    best = test.best(dataset.usual)
    text = f"{best}; points that land on their object again: {shares}"
    if best != dataset.usual:
        text += f"; the dataset's own program says: {dataset.usual}"
    yield Finding("principal point", text, defect=best != dataset.usual)


def _alignment(recording: Recording) -> Finding:
    found = alignment_of(recording)
    if found.offset_ms is None:
        return Finding("masks, events", f"no outline is clear enough in {found.frames} frames to tell", defect=False)
    late = f"{abs(found.offset_ms):.1f} ms {'later' if found.offset_ms > 0 else 'earlier'} than masks"
    words = f"events are {late} (outlines of {found.frames} frames, contrast {found.contrast:.2f})"
    return Finding("masks, events", words, defect=abs(found.offset_ms) > MISALIGNED_MS)


def _gaps(about: str, gaps: list[tuple[int, int]]) -> Finding:
    if not gaps:
        return Finding(about, "none", defect=False)
    start, stop = max(gaps, key=lambda gap: gap[1] - gap[0])
    words = f"{len(gaps):,}, the longest {(stop - start) * 1e-3:.1f} ms at {start * 1e-6:.3f} s"
    return Finding(about, words, defect=True)
