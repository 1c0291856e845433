"""Prophesee RAW: what their cameras send, in EVT 2.0, 2.1 or 3.0, after a header of text."""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.formats.event_file import EventFile
from evimo.formats.evt2_kernel import decode_evt2, decode_evt21, evt2_state
from evimo.formats.evt3_kernel import decode_evt3, evt3_state
from evimo.formats.prophesee_header import Encoding, encoding, head_is_second, header, sample
from evimo.formats.prophesee_sense import evt2_sense, evt3_sense, evt21_sense
from evimo.formats.word_file import WordFile, open_words

TITLES: dict[Encoding, str] = {"EVT2": "EVT 2.0", "EVT21": "EVT 2.1", "EVT3": "EVT 3.0"}


def open_prophesee_raw(path: Path, sensor: tuple[int, int] | None = None) -> EventFile:
    """Open a RAW file; triggers and words of the camera itself are passed over.

    Times are the sensor's own clock, whose bits (24 of EVT 3, 34 of the others) go on where they start over.

    Raises:
        BadFile: of another encoding, or without events.
    """
    head = header(path)
    name = encoding(path, head)
    words, start = _words(path, head.length, name)
    size = sensor or head.size()
    return open_words(words, start, title=f"Prophesee RAW ({TITLES[name]})", size=size, holds="a word")


def _words(path: Path, offset: int, name: Encoding) -> tuple[WordFile, NDArray[np.int64]]:
    """The words of a file, and the state before the first."""
    if name == "EVT3":
        return WordFile(path, offset, np.dtype("<u2"), decode_evt3, evt3_sense), evt3_state(0)
    if name == "EVT2":
        return WordFile(path, offset, np.dtype("<u4"), decode_evt2, evt2_sense), evt2_state()
    head = int(head_is_second(sample(path, offset)))
    decode: Any = partial(decode_evt21, head=head)
    sense = partial(evt21_sense, head=head)
    return WordFile(path, offset, np.dtype(("<u4", (2,))), decode, sense), evt2_state()
