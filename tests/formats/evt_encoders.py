"""Words of Prophesee's encodings, packed one by one from their documentation, for the tests of the decoders.

Each function gives the words and, for every event, the number of the word that holds it.
"""

import numpy as np


def evt2(events):
    """EVT 2.0 words, packed one by one from the documentation, and the number of the word of each event."""
    words, places, high = [], [], None
    for x, y, t, p in zip(*columns(events), strict=True):
        if t >> 6 != high:
            high = t >> 6
            words.append(8 << 28 | high & 0xFFFFFFF)
        places.append(len(words))
        words.append((p > 0) << 28 | (t & 63) << 22 | x << 11 | y)
    return np.array(words, "<u4"), np.array(places)


def evt21(events):
    """Pixels of one row, 32 columns and one instant and polarity share a word, as far as they follow each other."""
    words, places, high, last = [], [], None, None
    for x, y, t, p in zip(*columns(events), strict=True):
        if t >> 6 != high:
            high, last = t >> 6, None
            words.append((8 << 28 | high & 0xFFFFFFF) << 32)
        group = (x // 32, y, t, p)
        bit = 1 << x % 32
        if group == last and words[-1] & 0xFFFFFFFF < bit:
            words[-1] |= bit
        else:
            words.append(((p > 0) << 28 | (t & 63) << 22 | x // 32 * 32 << 11 | y) << 32 | bit)
        last = group
        places.append(len(words) - 1)
    return np.array(words, "<u8"), np.array(places)


def evt3(events, *, again_us=None):
    """Single pixels; a TIME HIGH comes where it changes, and again every `again_us` as cameras send it."""
    words, places, high, low, row, said = [], [], None, None, None, 0
    for x, y, t, p in zip(*columns(events), strict=True):
        if t >> 12 != high or (again_us and t >= said + again_us):
            high, low, said = t >> 12, None, t
            words.append(8 << 12 | high & 0xFFF)
        if t & 0xFFF != low:
            low = t & 0xFFF
            words.append(6 << 12 | low)
        if y != row:
            row = y
            words.append(y)
        places.append(len(words))
        words.append(2 << 12 | (p > 0) << 11 | x)
    return np.array(words, "<u2"), np.array(places)


def columns(events):
    return (column.tolist() for column in (events.x, events.y, events.t, events.p))
