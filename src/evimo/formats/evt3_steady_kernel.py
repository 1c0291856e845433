# pyright: basic
"""Stretches of EVT 3.0 words in which nothing is unusual, compiled: without a branch for each word.

A camera sends rows, columns and times in an order that no processor foresees. All that is known at a word is kept in
one number of 64 bits: each kind of word writes its own 12 bits of it. After every word that number is stored, and only
a column makes the next one be stored behind it. A second loop takes the numbers apart, many at a time.
"""

import numpy as np

from evimo.compiling import njit

PLAIN_WORDS, VECTOR_WORDS, VECTOR_PIXELS = 2048, 512, 12  # that are decoded together, without vectors and with them
MOST_TOGETHER = VECTOR_WORDS * VECTOR_PIXELS
COLUMN_AT, ROW_AT, BASE_AT, OTHER_AT, LOW_AT = 0, 12, 24, 36, 52  # where the 12 bits of each kind are
FIELD, KIND_AT, ONE, TWO, TWELVE = (np.uint64(number) for number in (0xFFF, 12, 1, 2, 12))
ROW_SHIFT, BASE_SHIFT, LOW_SHIFT = np.uint64(ROW_AT), np.uint64(BASE_AT), np.uint64(LOW_AT)
PLACE_OF = np.full(16, OTHER_AT, np.uint64)
PLACE_OF[[0, 2, 3, 6]] = ROW_AT, COLUMN_AT, BASE_AT, LOW_AT
LOWEST_BIT = np.array([(bits & -bits).bit_length() - 1 for bits in range(1 << 12)], np.int8)
POLARITY_AT, PIXEL = np.uint64(11), np.uint64(0x7FF)
LARGEST_BASE = 2047 - VECTOR_PIXELS  # from which a vector stays within 11 bits


@njit(nogil=True)
def together(words, at, until):
    """Where words that are decoded together end, and whether vectors are among them."""
    until, vectors = min(until, at + PLAIN_WORDS), np.uint16(0)
    for word in words[at:until]:
        vectors += np.uint16(word >> np.uint16(13) == np.uint16(2))
    return (min(until, at + VECTOR_WORDS), True) if vectors > 0 else (until, False)


@njit(nogil=True)
def at_first(low, base, polarity, row):
    """What is known before the first word, as one number."""
    sign = np.uint64(polarity > 0) << POLARITY_AT
    return np.uint64(low) << LOW_SHIFT | (sign | np.uint64(base)) << BASE_SHIFT | np.uint64(row) << ROW_SHIFT


@njit(nogil=True)
def at_last(known):
    """Base column, polarity and row after the last word."""
    base, row = known >> BASE_SHIFT & PIXEL, known >> ROW_SHIFT & PIXEL
    polarity = 2 * np.int64(known >> BASE_SHIFT >> POLARITY_AT & ONE) - 1
    return np.int64(base), polarity, np.int64(row)


@njit(nogil=True)
def ones(bits):
    """How many bits are set."""
    count = 0
    while bits != 0:
        count, bits = count + 1, bits & (bits - 1)
    return count


@njit(nogil=True)
def gathered(words, known, packed):
    """What is known at each event of words without vectors, how many there are, what is known after the last word, and
    a number that is negative where a lower TIME LOW follows a higher one."""
    count, back = np.uint64(0), np.int64(0)
    for short in words:
        word = np.uint64(short)
        kind, before = word >> KIND_AT, known
        place = PLACE_OF[kind]
        known = known & ~(FIELD << place) | (word & FIELD) << place
        back |= np.int64(known >> LOW_SHIFT) - np.int64(before >> LOW_SHIFT)
        packed[count] = known
        count += np.uint64(kind == TWO)
    return np.int64(count), known, back


@njit(nogil=True)
def gathered_vectors(words, known, packed):
    """As `gathered`, with vectors; negative, too, where one may leave the 11 bits of columns."""
    count, back = np.uint64(0), np.int64(0)
    for short in words:
        word = np.uint64(short)
        kind, value = word >> KIND_AT, word & FIELD
        if kind >> ONE == TWO:
            base = known >> BASE_SHIFT & FIELD
            first = known & ~FIELD | base
            back |= np.int64(LARGEST_BASE) - np.int64(base & PIXEL)
            while value != 0:
                packed[count] = first + np.uint64(LOWEST_BIT[value])
                count, value = count + ONE, value & (value - ONE)
            known += (TWELVE - ((kind & ONE) << TWO)) << BASE_SHIFT
        else:
            place, before = PLACE_OF[kind], known
            known = known & ~(FIELD << place) | value << place
            back |= np.int64(known >> LOW_SHIFT) - np.int64(before >> LOW_SHIFT)
            packed[count] = known
            count += np.uint64(kind == TWO)
    return np.int64(count), known, back


@njit(nogil=True)
def spread(packed, high, columns):
    """Columns of events, from what is known at each and the upper bits of the time."""
    x, y, t, p = columns
    for at in range(len(packed)):
        known = packed[at]
        x[at] = np.uint16(known) & np.uint16(0x7FF)
        y[at] = np.uint16(known >> ROW_SHIFT) & np.uint16(0x7FF)
        t[at] = high | np.int64(known >> LOW_SHIFT)
        p[at] = (np.int8(known >> np.uint64(10)) & np.int8(2)) - np.int8(1)
