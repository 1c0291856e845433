"""Rerun's own programs: its window, and its page in a browser, both offline and closed to other machines."""

import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Generator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import quote

from evimo.errors import BadInput, MissingExtra
from evimo.viewing.window.closed_page import HOST, closed_page, free_port
from evimo.viewing.window.store import installed_rerun

STARTS_S = 60.0  # within which the page must be there; a loaded machine takes its time
ENDS_S = 5.0
DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")


def has_display() -> bool:
    """Whether a window can be opened here."""
    return not sys.platform.startswith("linux") or any(os.environ.get(name) for name in DISPLAYS)


def check_display() -> None:
    """Make sure that a window can be opened.

    Raises:
        MissingExtra: Rerun is not installed. BadInput: there is no screen.
    """
    installed_rerun()
    if not has_display():
        raise BadInput("there is no screen to open a window on", fix="--web for a browser, or --save FILE.rrd or .mp4")


@contextmanager
def window(path: Path) -> Generator[subprocess.Popen[bytes]]:
    """Rerun's window with a file, while the `with` lasts; the process ends when the user closes it.

    Raises:
        BadInput: there is no screen. MissingExtra: Rerun is not installed.
    """
    check_display()
    with _started([str(path), "--bind", HOST, "--port", str(free_port()), "--hide-welcome-screen"]) as viewer:
        yield viewer


@contextmanager
def page(path: Path) -> Generator[tuple[subprocess.Popen[bytes], str]]:
    """A server of Rerun's page with a file, for browsers of this machine alone, and its address.

    Raises:
        BadInput: it did not start. MissingExtra: Rerun is not installed.
    """
    port, inner = free_port(), free_port()
    ports = ["--port", str(port), "--web-viewer-port", str(inner)]
    with _started([str(path), "--serve-web", "--bind", HOST, *ports, "--server-memory-limit", "75%"]) as server:
        _wait(server, inner)
        with closed_page(inner) as outer:
            yield server, f"http://{HOST}:{outer}/?url={quote(f'rerun+http://{HOST}:{port}/proxy', safe='')}"


@contextmanager
def _started(arguments: list[str]) -> Generator[subprocess.Popen[bytes]]:
    program = _program()
    # In what says that it is a test machine, Rerun sends nothing about its use to anybody, and asks no question.
    quiet = os.environ | {"CI": "1", "RUST_LOG": "error"}
    process = subprocess.Popen([program, *arguments], env=quiet, stdin=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(ENDS_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _program() -> str:
    """Rerun's own program, which lies beside its Python module: that module would start it as a child of a child."""
    installed_rerun()
    module = find_spec("rerun_cli")
    place = Path(module.origin).parent if module and module.origin else Path()
    program = shutil.which("rerun", path=os.pathsep.join((str(place), str(place / "Rerun.app" / "Contents" / "MacOS"))))
    if program is None:
        raise MissingExtra(f"there is no program `rerun` in {place}", extra="view")
    return program


def _wait(server: subprocess.Popen[bytes], port: int) -> None:
    """Until the server answers."""
    until_s = time.monotonic() + STARTS_S
    while time.monotonic() < until_s:
        if server.poll() is not None:
            break
        try:
            socket.create_connection((HOST, port), timeout=1).close()
            return
        except OSError:
            time.sleep(0.05)
    raise BadInput("Rerun's server did not start", fix="--save FILE.rrd, and `rerun FILE.rrd`")
