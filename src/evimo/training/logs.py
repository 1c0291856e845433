"""Numbers of a run by step, as CSV files."""

import csv
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

from evimo.writing import explained, save_text

Log = Callable[[int, dict[str, float]], None]


@contextmanager
def log_rows(path: Path, step: int) -> Generator[Log]:
    """A function that appends a row of named numbers to a CSV file, which begins to exist with its first row.

    step: the run goes on after it; rows of later steps, of a run that was killed, are dropped.

    Raises:
        BadInput: the file cannot be written, or the disk is full.
    """
    if path.exists():
        _keep_up_to(path, step)
    file: TextIO | None = None

    def row(step: int, values: dict[str, float]) -> None:
        nonlocal file
        if file is None:
            file = path.open("a", newline="")
        writer = csv.writer(file)
        if file.tell() == 0:
            writer.writerow(["step", *values])
        writer.writerow([step, *(f"{value:.5g}" for value in values.values())])
        file.flush()

    with explained(path):
        try:
            yield row
        finally:
            if file is not None:
                file.close()


def _keep_up_to(path: Path, step: int) -> None:
    header, *rows = path.read_text().splitlines(keepends=True)
    kept = [row for row in rows if row.split(",")[0].isdigit() and int(row.split(",")[0]) <= step]
    save_text("".join((header, *kept)), path)
