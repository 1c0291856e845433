"""A folder of outputs that are either whole or not there."""

import os
import shutil
import tempfile
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from evimo.errors import BadInput


class OutputFolder:
    """Collects new files beside the folder's old ones and moves them in when all are complete.

    Used as a context: leaving it without `keep` throws the new files away and leaves the old ones as they were.
    """

    def __init__(self, folder: str | Path) -> None:
        """Make the folder where it is missing.

        Raises:
            BadInput: it cannot be made or written.
        """
        self.folder = Path(folder)
        self._made = [path for path in (self.folder, *self.folder.parents) if not path.exists()]
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._partial = Path(tempfile.mkdtemp(prefix=".partial-", dir=self.folder))
        except OSError as error:
            raise BadInput(f"cannot write to {self.folder}: {error.strerror}", fix="another --out folder") from error

    def __enter__(self) -> "OutputFolder":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        shutil.rmtree(self._partial, ignore_errors=True)
        for made in self._made:
            with suppress(OSError):  # not empty
                made.rmdir()

    def path(self, name: str) -> Path:
        """Where to write the new file `name` until it is complete."""
        return self._partial / name

    def left_over(self, names: Iterable[str]) -> list[str]:
        """Which of these files are in the folder from before and will not be replaced."""
        return [name for name in names if (self.folder / name).exists() and not self.path(name).exists()]

    def keep(self) -> list[Path]:
        """Move every new file into the folder, over old ones of the same name; their paths, sorted."""
        moved: list[Path] = []
        for new in sorted(self._partial.iterdir()):
            os.replace(new, self.folder / new.name)
            moved.append(self.folder / new.name)
        return moved
