"""`evimo annotate`: truth for captures, from motion capture and scans."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from evimo.cli.progress import progress
from evimo.cli.several import check_apart
from evimo.errors import check_installed
from evimo.jobs.crew import ALONE, Crew
from evimo.writing import make_folder

ANNOTATING = ("scipy", "skimage", "trimesh")


def annotate(
    capture: Path,
    *more: Path,
    out: Path,
    rate: str = "40",
    layout: Literal["evimo2", "evimo1"] = "evimo2",
    threads: int | None = None,
    crew: Annotated[Crew, Parameter(name="*")] = ALONE,
) -> None:
    """Make the truth of captures: depth, objects and motion of recordings, from motion capture and scans.

    A capture is a folder with capture.yaml, which names the recording, the poses and the scans (docs/captures.md). It
    becomes recordings of up to five minutes with their truth, which all other commands take. Each is complete as soon
    as it exists; the same command again makes only those that are missing.

    Args:
        capture: its folder.
        more: captures.
        out: folder for the recordings, which are named after the captures' folders.
        rate: of frames of truth per second, or a text with a time in µs per line; 40 are the middles of all slices.
        layout: of EVIMO2, a folder, or of EV-IMO's first version, an .npz.
        threads: that draw a recording; by default one on each core, which --workers share.
        crew: who draws; each a whole recording.
    """
    check_installed("annotating", *ANNOTATING, extra="simulate")
    crew.check()
    from evimo.annotate.annotating import annotate_captures
    from evimo.annotate.annotation import Annotation, instants_of
    from evimo.captures.capture import open_capture

    instants, captures = instants_of(rate), dict.fromkeys((capture, *more))
    annotations = {path: Annotation(open_capture(path), instants, layout, threads) for path in captures}
    check_apart({path: out / annotation.name for path, annotation in annotations.items()})
    make_folder(out)
    frames = [count for each in annotations.values() for count in each.frames.values()]
    left = [each.frames[part] for each in annotations.values() for part in each.missing(out)]
    with progress(sum(frames), "frames") as advance:
        advance(sum(frames) - sum(left), made=False)
        for done in annotate_captures(annotations.values(), out, crew=crew, progress=advance):
            advance(done.instants - done.frames, made=False)  # the camera was lost, or another command was faster
    there = len(frames) - sum(len(each.missing(out)) for each in annotations.values())
    print(f"{there} recordings in {out}, {there - len(frames) + len(left)} of them made now")
