"""The unit of a recording's times: said by the user, or guessed and checked against what a camera can do."""

from typing import Literal

TimeUnit = Literal["s", "ms", "us", "ns"]
