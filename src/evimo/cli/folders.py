"""Folders that commands write into, made before the work begins."""

from pathlib import Path

from evimo.errors import BadInput


def make_folder(folder: Path) -> None:
    """Make it where it is missing.

    Raises:
        BadInput: it cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"cannot write to {folder}: {error.strerror}", fix="another --out folder") from error
