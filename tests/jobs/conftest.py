"""Work that other processes can import, and a Dask cluster of two processes."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def importable() -> Iterator[None]:
    """Let processes that are started now import `made_up_work`."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(HERE)
        patch.setenv("PYTHONPATH", os.pathsep.join([str(HERE), *filter(None, [os.environ.get("PYTHONPATH")])]))
        yield


@dataclass(frozen=True)
class Cluster:
    """A scheduler, as its scheduler file and its process, and its workers."""

    scheduler: str
    leader: subprocess.Popen[bytes]
    workers: list[subprocess.Popen[bytes]]


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory, importable: None) -> Iterator[Cluster]:
    """Two workers, of one process each, that nobody starts again."""
    pytest.importorskip("distributed", reason="needs evimo[cluster]")
    folder = tmp_path_factory.mktemp("cluster")
    file = folder / "scheduler.json"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder}

    def started(what: str, *options: str) -> subprocess.Popen[bytes]:
        program = [sys.executable, "-m", f"distributed.cli.dask_{what}", "--scheduler-file", str(file)]
        return subprocess.Popen([*program, "--host", "127.0.0.1", "--no-dashboard", *options], **quiet)

    processes = [started("scheduler", "--port", "0")]
    try:
        while not file.exists() and processes[0].poll() is None:
            time.sleep(0.05)
        processes += [started("worker", "--nthreads", "1", "--no-nanny") for _ in range(2)]
        yield Cluster(str(file), *processes[:1], processes[1:])
    finally:
        for process in reversed(processes):
            process.kill()
            process.wait()
