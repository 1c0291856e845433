"""Compiled code is cached, and must not outlive what it was made of."""

import re
from hashlib import sha256
from pathlib import Path

from evimo.scene import compiling
from evimo.scene.film import render
from evimo.simulate import bands
from evimo.simulate.bands import events_of

ROOM, SIMULATE = Path(compiling.__file__).parent, Path(bands.__file__).parent
BANDS = ("bands", "kernels", "logarithms")


def test_every_file_with_compiled_code_counts_for_the_cache():
    users = {
        file.stem for file in ROOM.glob("*.py") if re.search(r"^from evimo.scene.compiling", file.read_text(), re.M)
    }
    assert users | {"compiling"} == set(compiling.KERNELS)


def test_the_cache_is_told_about_all_of_them():
    """The attribute is numba's own affair; where it moves, this fails and a stale cache would go unnoticed."""
    folder, names = ROOM, compiling.KERNELS
    stamp = sha256(b"".join((folder / f"{name}.py").read_bytes() for name in names)).hexdigest()
    assert stamp in render._cache._cache_file._source_stamp
    stamp = sha256(b"".join((SIMULATE / f"{name}.py").read_bytes() for name in BANDS)).hexdigest()
    assert stamp in events_of._cache._cache_file._source_stamp
