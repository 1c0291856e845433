"""Who works on recordings: this process, several of this machine, or a Dask cluster."""

import os
from dataclasses import dataclass

from evimo.errors import BadInput, check_installed


@dataclass(frozen=True, slots=True, kw_only=True)
class Crew:
    """Who works on recordings; each works on a whole one.

    Args:
        workers: processes of this machine.
        dask: address of a Dask scheduler, as tcp://HOST:8786, or its scheduler file; the workers of that cluster take
            the recordings. They must see the same folders under the same names.
    """

    workers: int = 1
    dask: str | None = None

    @property
    def is_alone(self) -> bool:
        """Whether this process does all the work itself, and so can tell of every step."""
        return self.workers == 1 and self.dask is None

    def check(self) -> None:
        """Make sure that there may be somebody to do the work.

        Raises:
            BadInput: less than one worker, or workers here and on a cluster. MissingExtra: Dask is not installed.
        """
        if self.workers < 1:
            raise BadInput(f"{self.workers} workers", fix="at least one")
        if self.dask is not None and self.workers != 1:
            raise BadInput("--workers are of this machine, and --dask has its own", fix="one of the two")
        if self.dask is not None:
            check_installed("--dask", "distributed", extra="cluster")


ALONE = Crew()


def cores() -> int:
    """How many cores this process may use: what `NUMBA_NUM_THREADS` says, else all that it may run on."""
    told = os.environ.get("NUMBA_NUM_THREADS", "")
    allowed = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return int(told) if told.isdecimal() else allowed or 1
