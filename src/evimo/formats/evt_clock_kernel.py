# pyright: basic
"""Which words that carry the upper bits of a sensor's clock (TIME HIGH of EVT 2, 2.1 and 3) are to be believed.

Such a word is read together with those that follow it. The clock goes on by small steps and starts over when its
bits are full; a longer step, or one back, is believed only when the following words go on from it and do not return.
A word that is not believed is LOST, and with it the events until the next one that is.
"""

import numpy as np

from evimo.compiling import njit

UNKNOWN, LOST, UNDECIDED = -1, -2, -3
PART = 128  # words that are searched at a time
NEXT, MANY = 4, 8  # so many words after it speak for or against a step; of sparse recordings, more are asked
STEADY = 16  # after so many small steps a last long one, which nothing follows, is not believed

# What is kept from one block of words to the next: the last time believed, in units of the word, with the rounds of
# the clock counted; small steps since the last long one; and about when the first word was, in the same units.
CLOCK, STEPS, EXPECTED, CLOCK_STATE = 0, 1, 2, 3


@njit(nogil=True)
def clock_words(words, shift, high):
    """Values and places of the words whose upper bits, from `shift` on, are `high`.

    All three are of one type: numbers as short as the words are compared many at a time.
    """
    one_of, kind = words.dtype.type, words.dtype.type(high)
    number_of, places_of = np.empty(len(words) // PART + 1, np.uint16), np.empty(len(words) // PART + 1, np.uint16)
    for part in range(len(number_of)):
        some, number, places = words[PART * part : PART * (part + 1)], one_of(0), one_of(0)
        for at in range(len(some)):
            here = one_of(some[at] >> shift == kind)
            number += here
            places += here * one_of(at)
        number_of[part], places_of[part] = number, places
    return placed(words, shift, high, number_of, places_of)


@njit(nogil=True)
def placed(words, shift, high, number_of, places_of):
    """Values and places of the words, from how many each part holds and the sum of their places in it."""
    count, mask = number_of.sum(), (1 << shift) - 1
    values, places, number = np.empty(count, np.int64), np.empty(count, np.int64), 0
    for part in range(len(number_of)):
        if number_of[part] == 1:
            places[number] = PART * part + places_of[part]
            number += 1
        elif number_of[part] > 0:
            for at in range(PART * part, min(PART * (part + 1), len(words))):
                if words[at] >> shift == high:
                    places[number] = at
                    number += 1
    for number in range(count):
        values[number] = words[places[number]] & mask
    return values, places


@njit(nogil=True)
def believed_clocks(values, clock_state, bits, near, final):
    """The whole time of each word, or LOST; UNDECIDED from the first on that must wait for words after the last.

    `bits` is how many a word has, `near` the longest step, in units, that words after it confirm by being close; a
    step `near` / 16 long needs no more than that they do not speak against it.
    The state is left as it is: the caller advances it by as many words as it uses.
    """
    clocks = np.full(len(values), UNDECIDED, np.int64)
    clock, steps = clock_state[CLOCK], clock_state[STEPS]
    for at in range(len(values)):
        if clock == UNKNOWN:
            step = 0
        else:
            step = signed(values[at] - clock, bits)
            if step == 0:
                clocks[at] = clock
                continue
        ahead = len(values) - at - 1
        if ahead < MANY and not final:
            break
        if not confirmed(values, at, clock, bits, near, steps):
            clocks[at] = LOST
            continue
        if clock == UNKNOWN:
            clock = first_clock(values[at], clock_state[EXPECTED], bits)
        else:
            clock += step if clock + step >= 0 else step + (np.int64(1) << bits)
        steps = steps + 1 if 0 <= step <= near else 0
        clocks[at] = clock
    return clocks


@njit(nogil=True)
def advance(clock_state, clocks, near):
    """Keep in the state what words that are used have told."""
    for clock in clocks:
        if clock >= 0 and clock != clock_state[CLOCK]:
            small = clock_state[CLOCK] == UNKNOWN or 0 <= clock - clock_state[CLOCK] <= near
            clock_state[STEPS] = clock_state[STEPS] + 1 if small else 0
            clock_state[CLOCK] = clock


@njit(nogil=True, inline="always")
def signed(difference, bits):
    """A difference of two clocks as the nearest step from one to the other, forward or back."""
    half = np.int64(1) << (bits - 1)
    return ((difference + half) & ((np.int64(1) << bits) - 1)) - half


@njit(nogil=True)
def first_clock(value, expected, bits):
    """The first time, in the last round of the clock that begins before `expected`."""
    return max((expected - value) >> bits, 0) << bits | value


@njit(nogil=True)
def confirmed(values, at, clock, bits, near, steps):
    """Whether the words after number `at` go on from it, rather than from the clock before."""
    value, ahead = values[at], len(values) - at - 1
    step = 0 if clock == UNKNOWN else signed(value - clock, bits)
    near_ones, against = 0, 0
    for other in range(at + 1, at + 1 + min(ahead, NEXT)):
        on = signed(values[other] - value, bits)
        back = -1 if clock == UNKNOWN else signed(values[other] - clock, bits)
        if 0 <= on <= near and (step >= 0 or back < 0):
            near_ones += 1
        elif back >= 0 and (on < 0 or step < 0):
            against += 1
    if 0 < 16 * step <= near or ahead == 0:
        calm = clock == UNKNOWN or 0 <= step <= near or (step > 0 and steps < STEADY)
        return (near_ones > against or against == 0) and calm
    if clock == UNKNOWN and near_ones == 0 and steady_after(values, at, bits, near):
        return False
    asked = min(ahead, NEXT)
    if near_ones >= asked - (asked > 2) and near_ones > against:
        return True
    return step >= 0 and near_ones >= against and in_order(values, at, bits)


@njit(nogil=True)
def steady_after(values, at, bits, near):
    """Whether some of the words after number `at` go on from each other by small steps: a clock of its own.

    A first word that has none near it, as the last of damage at the beginning, would otherwise count a round too many.
    """
    steps = 0
    for other in range(at + 2, min(at + 1 + MANY, len(values))):
        steps += 0 <= signed(values[other] - values[other - 1], bits) <= near
    return steps >= NEXT - 1


@njit(nogil=True)
def in_order(values, at, bits):
    """Whether the next words, all but one, never go back, however long their steps: a recording with few events."""
    asked = min(len(values) - at - 1, MANY)
    since = np.empty(asked + 1, np.int64)  # word `at`
    length = np.zeros(asked + 1, np.int64)  # of the longest chain from word `at` to this one
    since[0], length[0], longest = 0, 1, 1
    for second in range(1, asked + 1):
        since[second] = signed(values[at + second] - values[at], bits)
        for first in range(second):
            if length[first] > 0 and since[second] >= since[first]:
                length[second] = max(length[second], length[first] + 1)
        longest = max(longest, length[second])
    return longest > asked - (asked > 2)
