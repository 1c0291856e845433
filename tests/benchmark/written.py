"""What `evimo benchmark` has written."""

import csv
import io
from pathlib import Path

MODELS = ["--models", "half", "perfect"]


def values_in(out: Path) -> dict[tuple[str, ...], float]:
    rows = csv.DictReader(io.StringIO((out / "benchmark.csv").read_text()))
    return {(row["table"], row["scene"], row["row"], row["score"]): float(row["value"]) for row in rows}
