"""`evimo annotate`: truth for a capture, from motion capture and scans."""

from pathlib import Path
from typing import Literal

from evimo.cli.progress import progress
from evimo.errors import check_installed
from evimo.writing import make_folder

ANNOTATING = ("scipy", "skimage", "trimesh")


def annotate(
    capture: Path,
    *,
    out: Path,
    rate: str = "40",
    layout: Literal["evimo2", "evimo1"] = "evimo2",
    threads: int = 2,
) -> None:
    """Make the truth of a capture: depth, objects and motion of a recording, from motion capture and scans.

    A capture is a folder with capture.yaml, which names the recording, the poses and the scans (docs/captures.md). It
    becomes recordings of up to five minutes with their truth, which all other commands take. Each is complete as soon
    as it exists; the same command again makes only those that are missing.

    Args:
        capture: its folder.
        out: folder for the recordings, named after the capture's folder.
        rate: of frames of truth per second, or a text with a time in µs per line; 40 are the middles of all slices.
        layout: of EVIMO2, a folder, or of EV-IMO's first version, an .npz.
        threads: that draw.
    """
    check_installed("annotating", *ANNOTATING, extra="simulate")
    from evimo.annotate.annotation import Annotation, instants_of
    from evimo.captures.capture import open_capture

    annotation = Annotation(open_capture(capture), instants_of(rate), layout, threads)
    make_folder(out)
    missing, parts = annotation.missing(out), annotation.parts
    lengths = {part: len(annotation.instants.between(*annotation.span(part))) for part in range(parts)}
    with progress(sum(lengths.values()), "frames") as advance:
        advance(sum(lengths.values()) - sum(lengths[part] for part in missing), made=False)
        for part in missing:
            left = lengths[part]
            for _ in annotation.write(out, part):
                left -= 1
                advance()
            advance(left, made=False)  # instants at which the camera was lost
    print(f"{parts} recordings in {out}, {len(missing)} of them made now")
