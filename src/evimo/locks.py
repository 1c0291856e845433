"""Locks of hidden folders: held while the process that fills a folder lives, so that others tell it from a leftover."""

import errno
import os
import shutil
import sys
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

LOCK = "lock"


def locked(folder: Path, *, unsure: bool) -> BinaryIO | None:
    """The lock of a hidden folder, open; None where another process has it.

    unsure: whether it is ours where files cannot be locked at all, as on some network disks.

    Raises:
        OSError: there is no such folder any more, or no lock can be made in it.
    """
    path = folder / LOCK
    lock = path.open("ab")
    try:
        if _take(lock, unsure=unsure) and os.path.samestat(os.fstat(lock.fileno()), path.stat()):
            return lock
    except BaseException:
        lock.close()
        raise
    lock.close()
    return None


def _take(lock: BinaryIO, *, unsure: bool) -> bool:
    """Whether an open file could be locked; `unsure` where files cannot be locked at all."""
    try:
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(lock.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return unsure and error.errno in (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS, errno.EINVAL)
    return True


def remove(folder: Path, lock: BinaryIO) -> None:
    """Remove a hidden folder whose lock we have, and nothing of who makes and locks a folder of that name meanwhile."""
    if sys.platform == "win32":  # nothing that is open can be removed there
        lock.close()
        shutil.rmtree(folder, ignore_errors=True)
        return
    shutil.rmtree(folder, ignore_errors=True)
    lock.close()
    with suppress(OSError):  # a network disk keeps the name of an open file until it is closed
        folder.rmdir()
