"""A Rerun file that is being written: the only place that knows how Rerun is called and how it fails."""

import os
from collections.abc import Generator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.errors import BadInput, check_installed
from evimo.events.slices import SLICE_US
from evimo.writing import new_file

APPLICATION = "evimo"
TIME, SLICE = "time", "slice"
"""The time lines: the recording's own clock, and the numbers of its slices of 25 ms."""

FLUSH = 20  # slices, after which everything must be on disk: bounds memory, and a full disk is heard of
PIECE = 1 << 16  # bytes
LATEST_US = 9_000_000_000_000_000  # Rerun counts ns in 64 bits


def installed_rerun() -> Any:
    """The module `rerun`, imported when it is first needed.

    Raises:
        MissingExtra: it is not installed.
    """
    check_installed("the window", "rerun", extra="view")
    os.environ.setdefault("RUST_LOG", "off")  # what it says of a full disk, we say in one line
    return import_module("rerun")


class Store:
    """Takes what a window shows, at times in µs of the recording's own clock; made by `new_store`.

    rr: the module `rerun`, whose archetypes are logged.
    """

    def __init__(self, path: Path, *, name: str) -> None:
        self.rr, self._slices = installed_rerun(), 0
        self._stream: Any = self.rr.RecordingStream(APPLICATION, recording_id=name)
        self._stream.set_log_time_enabled(False)
        self._stream.set_log_tick_enabled(False)
        self._file = _Poured(path)
        self._stream.save(self._file.mouth)
        self._file.begin()
        self._stream.send_recording_name(name)

    def arrange(self, blueprint: Any) -> None:
        """Say which views there are, and where."""
        self._stream.send_blueprint(blueprint)

    def log(self, entity: str, *parts: Any, t_us: int) -> None:
        """Log archetypes at a time."""
        if abs(t_us) > LATEST_US:
            raise BadInput(
                f"a window cannot show the time {t_us} µs", fix="a recording whose clock is not broken, or a video"
            )
        self._stream.set_time(TIME, duration=np.timedelta64(t_us, "us"))
        self._stream.set_time(SLICE, sequence=t_us // SLICE_US)
        self._stream.log(entity, *parts, strict=True)

    def log_always(self, entity: str, *parts: Any) -> None:
        """Log archetypes that hold at all times."""
        self._stream.log(entity, *parts, static=True, strict=True)

    def log_columns(self, entity: str, columns: Any, *, times_us: NDArray[np.int64]) -> None:
        """Log one value for each of many times at once."""
        if not len(times_us):
            return
        lines = [
            self.rr.TimeColumn(TIME, duration=times_us.astype("timedelta64[us]")),
            self.rr.TimeColumn(SLICE, sequence=times_us // SLICE_US),
        ]
        self._stream.send_columns(entity, lines, columns, strict=True)

    def finished_slice(self) -> None:
        """Called after each slice.

        Raises:
            OSError: the disk is full, or cannot be written any more.
        """
        self._slices += 1
        if self._slices % FLUSH == 0:
            self._stream.flush()
            self._file.check()

    def close(self) -> None:
        """Finish the file.

        Raises:
            OSError: as `finished_slice`.
        """
        self._stream.flush()
        self._stream.disconnect()
        self._file.finish()


class _Poured:
    """A file that is filled through a pipe, by a thread that goes on reading when the disk is full.

    Rerun waits for ever for a disk that takes no more, even when it is let go.

    mouth: path of the pipe's end that is to be opened for writing; `begin` follows when it is.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("wb")
        self._out, self._in = os.pipe()
        self.mouth = f"/dev/fd/{self._in}"
        self._error: OSError | None = None
        self._thread = Thread(target=self._pour, daemon=True)

    def begin(self) -> None:
        """Start to read; it ends when whoever has opened the mouth closes it."""
        os.close(self._in)
        self._thread.start()

    def check(self) -> None:
        """Raise what the disk said.

        Raises:
            OSError: it is full, or cannot be written any more.
        """
        if self._error is not None:
            raise self._error

    def finish(self) -> None:
        """Wait for the end of the file, and close it.

        Raises:
            OSError: as `check`.
        """
        self._thread.join()
        self.check()

    def _pour(self) -> None:
        with open(self._out, "rb", buffering=0) as pipe:
            while piece := pipe.read(PIECE):
                if self._error is None:
                    self._write(piece)
        self._close()

    def _write(self, piece: bytes) -> None:
        try:
            self._file.write(piece)
            self._file.flush()
        except OSError as error:
            self._error = OSError(error.errno, error.strerror, self._file.name)

    def _close(self) -> None:
        try:
            self._file.close()
        except OSError as error:
            self._error = self._error or OSError(error.errno, error.strerror, self._file.name)


@contextmanager
def new_store(path: Path, *, name: str, fix: str) -> Generator[Store]:
    """A Rerun file that appears under its name when the `with` ends without an error, and else not at all.

    Args:
        path: of the file, .rrd.
        name: of the recording, as the window tells it.
        fix: of the error that a disk causes.

    Raises:
        MissingExtra: Rerun is not installed. BadInput: the file cannot be written, the disk is full, or on Windows.
    """
    installed_rerun()
    if not Path("/dev/fd").exists():
        raise BadInput("the window needs a system with /dev/fd, as Linux and macOS are", fix="--save FILE.mp4, a video")
    with new_file(path, fix=fix) as unfinished:
        store = Store(unfinished, name=name)
        try:
            yield store
        finally:
            store.close()
