# pyright: basic
"""Stretches of EVT 3.0 words in which nothing is unusual, compiled: without a branch for each word.

A camera sends rows, columns and times in an order that no processor foresees. All that is known at a word is kept in
one number of 64 bits: words of time, row and base each have 16 bits of it, all others share those of the column. After
every word that number is stored, and only a column makes the next one be stored behind it. A second loop takes the
numbers apart, many at a time.
"""

import numpy as np

from evimo.compiling import njit

TOGETHER, VECTOR_PIXELS = 2048, 12  # words that are decoded at once, pixels of a vector
ROW, COLUMN, BASE, TIME_LOW = 0, 2, 3, 6  # kinds of words
ROW_AT, BASE_AT, LOW_AT = (np.uint64(place) for place in (16, 32, 48))  # the column is at 0
PLACE_OF = np.zeros(16, np.uint64)
PLACE_OF[[ROW, BASE, TIME_LOW]] = ROW_AT, BASE_AT, LOW_AT
VALUE, KIND_AT, ONE, TWO, TWELVE = (np.uint64(number) for number in (0xFFF, 12, 1, 2, 12))
LOWEST_BIT = np.array([(bits & -bits).bit_length() - 1 for bits in range(1 << 12)], np.int8)
POLARITY_AT, PIXEL, COORDINATE = np.uint64(11), np.uint64(0x7FF), np.uint16(0x7FF)
SHORT, BELOW_LOW = np.uint64(0xFFFF), (ONE << LOW_AT) - ONE
LARGEST_BASE = 2047 - VECTOR_PIXELS  # from which a vector stays within 11 bits


@njit(nogil=True)
def with_vectors(words):
    """Whether vectors are among words."""
    for first in range(0, len(words), TOGETHER):
        some, vectors = words[first : first + TOGETHER], np.uint16(0)
        for at in range(len(some)):
            vectors += np.uint16(some[at] >> np.uint16(13) == np.uint16(2))
        if vectors > 0:
            return True
    return False


@njit(nogil=True)
def at_first(low, base, polarity, row):
    """What is known before the first word, as one number."""
    time, sign = np.uint64(TIME_LOW << 12 | low), np.uint64(polarity > 0) << POLARITY_AT
    return time << LOW_AT | (sign | np.uint64(base)) << BASE_AT | np.uint64(row) << ROW_AT


@njit(nogil=True)
def at_last(known):
    """Base column, polarity and row after the last word."""
    base, row = known >> BASE_AT & PIXEL, known >> ROW_AT & PIXEL
    polarity = 2 * np.int64(known >> BASE_AT >> POLARITY_AT & ONE) - 1
    return np.int64(base), polarity, np.int64(row)


@njit(nogil=True)
def ones(bits):
    """How many bits are set."""
    count = 0
    while bits != 0:
        count, bits = count + 1, bits & (bits - 1)
    return count


@njit(nogil=True)
def gathered(words, known, events):
    """What is known at each event of words without vectors, how many there are, what is known after the last word, and
    a number that is negative where a lower TIME LOW follows a higher one.
    """
    count, back = np.uint64(0), np.uint64(0)
    for at in range(len(words)):
        word, before = np.uint64(words[at]), known
        place = PLACE_OF[word >> KIND_AT]
        known = known & ~(SHORT << place) | word << place
        back |= (known | BELOW_LOW) - before
        events[count] = np.int64(known)
        count += np.uint64(word >> KIND_AT == COLUMN)
    return np.int64(count), known, np.int64(back)


@njit(nogil=True)
def gathered_vectors(words, known, events):
    """As `gathered`, with vectors; negative, too, where one may leave the 11 bits of columns."""
    count, back = np.uint64(0), np.int64(0)
    for at in range(len(words)):
        word = np.uint64(words[at])
        kind, value = word >> KIND_AT, word & VALUE
        if kind >> ONE == TWO:
            base = known >> BASE_AT & VALUE
            first = known & ~SHORT | base
            back |= np.int64(LARGEST_BASE) - np.int64(base & PIXEL)
            while value != 0:
                events[count] = np.int64(first + np.uint64(LOWEST_BIT[value]))
                count, value = count + ONE, value & (value - ONE)
            known += (TWELVE - ((kind & ONE) << TWO)) << BASE_AT
        else:
            before, place = known, PLACE_OF[kind]
            known = known & ~(SHORT << place) | word << place
            back |= np.int64((known | BELOW_LOW) - before)
            events[count] = np.int64(known)
            count += np.uint64(kind == COLUMN)
    return np.int64(count), known, back


@njit(nogil=True)
def spread(columns, high):
    """Columns of events, from what is known at each in place of its time, and the upper bits of the time."""
    x, y, t, p = columns
    for at in range(len(t)):
        known = np.uint64(t[at])
        x[at], y[at] = np.uint16(known) & COORDINATE, np.uint16(known >> ROW_AT) & COORDINATE
        p[at] = (np.int8(known >> np.uint64(10)) & np.int8(2)) - np.int8(1)
        t[at] = high | np.int64(known >> LOW_AT & VALUE)
