"""What one number of a report is."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class Column:
    """One column of a table; `name` is the score's name, `of` the movers it is of, if not all."""

    name: str
    header: str
    better: Literal["higher", "lower"]
    meaning: str
    digits: int = 3
    unit: str = ""
    of: str = ""
