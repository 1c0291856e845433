"""Compiled code is cached, and must not outlive what it was made of."""

import re
from pathlib import Path

from evimo.scene import compiling

ROOM = Path(compiling.__file__).parent


def test_every_file_with_compiled_code_counts_for_the_cache():
    users = {
        file.stem for file in ROOM.glob("*.py") if re.search(r"^from evimo.scene.compiling", file.read_text(), re.M)
    }
    assert users | {"compiling"} == set(compiling.KERNELS)


def test_the_cache_is_told_about_all_of_them():
    """The attribute is numba's own affair; where it moves, this fails and a stale cache would go unnoticed."""
    from evimo.scene.film import render

    assert compiling._STAMP in render._cache._cache_file._source_stamp
