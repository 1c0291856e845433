"""Compiled code is cached, and must not outlive what it was made of."""

import re
from hashlib import sha256
from pathlib import Path

from evimo.scene.rays import compiling
from evimo.scene.rays.film import render
from evimo.simulate import bands
from evimo.simulate.bands import events_of

ROOM, SIMULATE = Path(compiling.__file__).parent, Path(bands.__file__).parent


def test_every_file_with_compiled_code_counts_for_the_cache():
    uses = re.compile(r"^from evimo.scene.rays.compiling", re.M)
    users = {file for file in ROOM.parent.rglob("*.py") if uses.search(file.read_text())}
    assert users | {ROOM / "compiling.py"} == {(ROOM / f"{name}.py").resolve() for name in compiling.KERNELS}


def test_every_file_that_event_pixels_call_counts_for_their_cache():
    calls = re.findall(r"^from evimo\.(\S+) import", Path(bands.__file__).read_text(), re.M)
    files = {SIMULATE.parent / f"{name.replace('.', '/')}.py" for name in calls} | {SIMULATE / "bands.py"}
    assert files == {(SIMULATE / f"{name}.py").resolve() for name in bands.KERNELS}


def test_the_cache_is_told_about_all_of_them():
    """The attribute is numba's own affair; where it moves, this fails and a stale cache would go unnoticed."""
    folder, names = ROOM, compiling.KERNELS
    stamp = sha256(b"".join((folder / f"{name}.py").read_bytes() for name in names)).hexdigest()
    assert stamp in render._cache._cache_file._source_stamp
    stamp = sha256(b"".join((SIMULATE / f"{name}.py").read_bytes() for name in bands.KERNELS)).hexdigest()
    assert stamp in events_of._cache._cache_file._source_stamp
