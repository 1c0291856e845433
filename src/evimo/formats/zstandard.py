"""Zstandard, from the standard library where Python has it and from its backport where not."""

from typing import Any


def zstd() -> Any:
    """Return the module that compresses and decompresses."""
    try:
        from compression import zstd  # type: ignore[import-not-found]  # Python 3.14
    except ImportError:
        from backports import zstd
    return zstd
