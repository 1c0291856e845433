"""`evimo check`: the defects of a recording."""

from pathlib import Path

from evimo.cli.exit_codes import DEFECTS
from evimo.cli.reading import AS_TOLD, Reading
from evimo.errors import in_one_line


def check(path: Path, *, reading: Reading = AS_TOLD) -> int:
    """Look for defects: gaps, disorder, wrong polarity, bad poses, a wrong principal point, masks beside their events.

    Every line that begins with ! is a defect; where there is one, the exit code is 3. The principal point is tested by
    carrying points of an object from one frame to another, and the agreement of masks and events by when the outlines
    of what moves fire most.

    Args:
        path: any recording that can be read, with truth or without.
        reading: what the file does not tell.
    """
    from evimo.recordings.checking import findings

    events = path / "events.txt" if (path / "events.txt").exists() else path
    defects = 0
    for finding in findings(path, reading.opened(events)):
        defects += finding.defect
        print(f"{'!' if finding.defect else ' '} {finding.about:<16}{in_one_line(finding.words)}", flush=True)
    print(f"{defects} defects" if defects != 1 else "1 defect")
    return DEFECTS if defects else 0
