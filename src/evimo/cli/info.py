"""`evimo info`: what is inside a recording."""

from pathlib import Path

from evimo.cli.reading import AS_TOLD, Reading
from evimo.errors import in_one_line
from evimo.events.gyroscope import Gyroscope
from evimo.formats import EventFile, FoundCamera


def info(file: Path, *, reading: Reading = AS_TOLD) -> None:
    """Print format, sensor, span, events, rate, polarity, order of timestamps, and what else is inside.

    Args:
        file: an event recording: a file, or an EVIMO2 folder.
        reading: what the file does not tell.
    """
    for name, value in facts(reading.opened(file)).items():
        print(f"{name:<13}{in_one_line(value)}")


def facts(recording: EventFile) -> dict[str, str]:
    """What `info` prints, name to words; reads the whole recording once."""
    events, on = 0, 0
    for packet in recording:
        events += len(packet)
        on += int((packet.p > 0).sum())
    height, width = recording.sensor
    span_s = (recording.stop_us - recording.start_us) * 1e-6
    return {
        "file": str(recording.path),
        "format": recording.format,
        "sensor": f"{width}x{height}",
        "span": f"{span_s:.6f} s",
        "first event": f"{recording.start_us} µs",
        "last event": f"{recording.stop_us - 1} µs",
        "events": f"{events:,}",
        "rate": f"{events / span_s * 1e-6:.3f} million events/s",
        "polarity": f"{on / max(events, 1):.1%} on, {1 - on / max(events, 1):.1%} off",
        "timestamps": _order(recording),
        "camera": _camera(recording.camera),
        "gyroscope": _gyroscope(recording.gyroscope()),
        **({"topic": recording.topic} if recording.topic else {}),
        **recording.contents,
    }


def _order(recording: EventFile) -> str:
    """Whether timestamps are sorted; all faults of the pass, if there are any."""
    faults = recording.faults
    sorted_or_not = "not sorted" if faults.out_of_order + faults.late + faults.after_reset else "sorted"
    return "; ".join([sorted_or_not, *faults.parts(recording.sensor)])


def _gyroscope(gyroscope: Gyroscope | None) -> str:
    if gyroscope is None:
        return "none"
    axes = "in camera axes" if gyroscope.in_camera_axes else "in its own axes"
    return f"{len(gyroscope):,} samples, {gyroscope.rate_hz:,.0f} Hz, {axes} ({gyroscope.source})"


def _camera(found: FoundCamera | None) -> str:
    if found is None:
        return "no intrinsics inside"
    camera, source = found
    values = " ".join(f"{value:.4g}" for value in camera.distortion)
    lens = "" if camera.is_pinhole else f", {camera.lens} {values}"
    return f"fx {camera.fx:.2f} fy {camera.fy:.2f} cx {camera.cx:.2f} cy {camera.cy:.2f}{lens} ({source})"
