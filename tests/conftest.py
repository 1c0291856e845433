"""Fixtures that every room uses."""

import signal
from collections.abc import Callable
from pathlib import Path

import pytest

# A shell's background jobs ignore Ctrl-C, what nohup starts ignores SIGHUP, and so would every command that a test
# starts to end it so.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

SHARED = Path(__file__).parents[2] / "shared" / "data"


@pytest.fixture
def shared_data() -> Callable[[str], Path]:
    """The path of a real recording, scan or calibration; skips where the folder beside the checkout is absent."""

    def path(name: str) -> Path:
        if not (SHARED / name).exists():
            pytest.skip(f"needs ../shared/data/{name}, real data that is not part of the repository")
        return SHARED / name

    return path
