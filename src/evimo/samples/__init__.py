"""This room holds the recording that comes with the package: two simulated seconds, for a first look and for tests."""

from pathlib import Path

from evimo.errors import NotFound


def path() -> Path:
    """The packaged recording, a file that `open_events` reads.

    Raises:
        NotFound: the installation is not complete.
    """
    recordings = sorted(Path(__file__).parent.glob("*.npz"))
    if not recordings:
        raise NotFound("this installation of evimo has no sample recording", fix="install the package again")
    return recordings[0]
