"""Jobs on the machines of a Dask cluster, which sees the same folders and has the same evimo.

Each worker of the cluster has processes of its own for the jobs, one core each, so that a job that dies takes nothing
else with it, and one that nobody waits for any more is broken off.
"""

import json
import logging
import platform
import re
import socket
import threading
import warnings
from collections.abc import Callable, Generator
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from evimo.errors import BadInput, EvimoError, EvimoWarning, NotFound
from evimo.jobs.outcome import Outcome
from evimo.jobs.processes import Processes
from evimo.writing import held_folder, is_held

if TYPE_CHECKING:
    from distributed import Client, Future

CONNECTING_S, LEAVING_S = 10.0, 5.0
SAME_EVIMO = "the same evimo with the same packages for the command, the scheduler and all workers"

_lock = threading.Lock()
_processes: dict[Path, Processes] = {}  # in a worker of the cluster: by the folder that their command holds


@contextmanager
def connected(scheduler: str, shared: Path) -> Generator[Callable[[bytes], "_Pending"]]:
    """Connect to a cluster; yield what takes a job, as `processes.packed` made it, for its workers.

    shared: folder that all see. While the `with` lasts, a hidden folder is held in it, by which others know that it
        does, and that the folder really is shared.

    Raises:
        NotFound, BadInput: there is no scheduler. BadInput: the folder cannot be written.
    """
    client = _client(scheduler)
    keys, futures = f"evimo-{uuid4().hex}", list["Future[Any]"]()
    try:
        with held_folder(shared.absolute()) as held:
            release = _release()

            def submit(job: bytes) -> _Pending:
                future = client.submit(_outcome_here, job, release, held, key=f"{keys}-{len(futures)}", pure=False)
                futures.append(future)
                return _Pending(future)

            try:
                yield submit
            finally:
                _leave(client, futures)
    finally:
        with suppress(Exception):
            client.close(LEAVING_S)


class _Pending:
    """An outcome that the cluster owes, whatever happens to it."""

    def __init__(self, future: "Future[Any]") -> None:
        self._future = future

    def add_done_callback(self, fn: Callable[["_Pending"], Any], /) -> None:
        """Have it handed over when it has come."""

        def hand_over(_: Any) -> None:
            fn(self)

        self._future.add_done_callback(hand_over)

    def result(self) -> Outcome:
        """The outcome; an error in it where several workers died of the job.

        Raises:
            EvimoError: the cluster is not there any more, or does not know what to do.
        """
        from distributed import KilledWorker

        try:
            return self._future.result()
        except KilledWorker as error:
            problem = f"{error.allowed_failures + 1} workers of the Dask cluster died while they worked on it"
            return Outcome(error=EvimoError(problem, fix="the same command again, with more memory for each worker"))
        except (CancelledError, OSError) as error:
            fix = "the same command again, which goes on from what is finished"
            raise EvimoError("the Dask scheduler has gone", fix=fix) from error
        except Exception as error:
            raise EvimoError(" ".join(f"the Dask cluster cannot work: {error}".split()), fix=SAME_EVIMO) from error


def _client(scheduler: str) -> "Client":
    from distributed import Client

    for name in [*logging.root.manager.loggerDict]:
        if name.startswith(("distributed", "tornado")):
            logging.getLogger(name).setLevel(logging.CRITICAL)  # what is to be said of it, we say
    address = _address(scheduler)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of versions, which we compare ourselves
            client = Client(address, timeout=CONNECTING_S, set_as_default=False)
    except OSError as error:
        raise NotFound(f"no Dask scheduler at {scheduler}: {error}", fix="start one: dask scheduler") from error
    if not client.scheduler_info()["workers"]:
        problem = f"the Dask cluster at {scheduler} has no workers yet: waiting for them"
        warnings.warn(problem, EvimoWarning, stacklevel=2)
    return client


def _address(scheduler: str) -> str:
    """The address that is meant; Dask would leave a thread behind at one that is none."""
    try:
        address = json.loads(file.read_text())["address"] if (file := Path(scheduler)).is_file() else scheduler
    except (ValueError, KeyError, TypeError):
        address = ""
    if not re.fullmatch(r"((tcp|tls|ws|wss)://)?[^/]+:\d+", str(address)):
        problem = f"{scheduler!r} is no address of a Dask scheduler"
        raise BadInput(problem, fix="tcp://HOST:8786, or the file of dask scheduler --scheduler-file")
    return address


def _leave(client: "Client", futures: list["Future[Any]"]) -> None:
    """Take back what has not begun; what has, ends when the held folder goes."""
    if client.status == "running":
        with suppress(Exception):
            client.cancel([future for future in futures if not future.done()])


def _outcome_here(job: bytes, release: str, held: Path) -> Outcome:
    """In a worker of the cluster: what came of a job."""
    where = socket.gethostname()
    if (ours := _release()) != release:
        problem = f"the Dask worker on {where} has {ours}, and the command {release}"
        return Outcome(error=EvimoError(problem, fix=SAME_EVIMO))
    if not held.exists():
        problem = f"the Dask worker on {where} does not see what is written to {held.parent}"
        return Outcome(error=EvimoError(problem, fix="an --out on a disk that all machines share, under the same name"))
    if not is_held(held):
        problem = f"files that are locked in {held.parent} are not locked for the Dask worker on {where}"
        return Outcome(error=EvimoError(problem, fix="a disk whose locks hold for all machines"))
    with _lock:
        over = [other for other, processes in _processes.items() if other != held and processes.is_over]
        for other in over:
            del _processes[other]
        processes = _processes.setdefault(held, Processes(threads=1, held=held))
    outcome = processes.outcome(job)
    if isinstance(error := outcome.error, EvimoError):
        return outcome._replace(error=type(error)(f"{error.problem} (on {where})", fix=error.fix))
    return outcome


def _release() -> str:
    """What must be the same everywhere, so that every machine makes the same bytes."""
    folder = Path(__file__).parents[1]
    code = sha256()
    for file in sorted(folder.rglob("*.py")):
        code.update(file.relative_to(folder).as_posix().encode() + file.read_bytes())
    others = ", ".join(f"{name} {version(name)}" for name in ("numpy", "numba"))
    return f"evimo {version('evimo')} ({code.hexdigest()[:12]}), {others}, Python {platform.python_version()}"
