# pyright: basic
"""Parsing of text lines with the numbers of one event each, compiled.

A line of plain digits between single separators, as nearly all are, is read in one loop; any other by `line_values`.
"""

import numpy as np

from evimo.compiling import njit
from evimo.formats.clock_rules import MOST_US, NO_TIME

NEWLINE, SPACE, TAB, RETURN, COMMA, SEMICOLON, QUOTE, APOSTROPHE = 10, 32, 9, 13, 44, 59, 34, 39
MINUS, PLUS, DOT, ZERO, NINE, LOWER_E, UPPER_E = 45, 43, 46, 48, 57, 101, 69
LONG_MINUS = np.array([0xE2, 0x88, 0x92], np.uint8)  # U+2212, as some spreadsheets write it, in UTF-8
HASH, PERCENT = 35, 37
OUTSIDE = 65535
POWERS = 10 ** np.arange(19, dtype=np.int64)
T, X, Y, P, SKIPPED = range(5)  # what a column holds
TRUE, FALSE, ON, OFF = (np.frombuffer(name, np.uint8) for name in (b"true", b"false", b"on", b"off"))
LONGEST = 18  # digits of a number that is read in the fast loop
ONE = np.uintp(1)
FRACTIONS, ROUNDED, BAD, FIRST_BAD = range(4)  # of the counts


@njit(nogil=True, error_model="numpy")
def is_blank(byte):
    """Whether a byte separates numbers of one line."""
    return byte in (SPACE, COMMA, TAB, SEMICOLON, RETURN, QUOTE, APOSTROPHE)


@njit(nogil=True, error_model="numpy")
def digits(raw, at, value, dropped):
    """Digits appended to a value of at most 17 of them. Returns value, digits that did not fit, position after."""
    while at < len(raw) and ZERO <= raw[at] <= NINE:
        if value < 10**16:
            value = value * 10 + (raw[at] - ZERO)
        else:
            dropped += 1
        at += 1
    return value, dropped, at


@njit(nogil=True, error_model="numpy")
def number(raw, at):
    """The number at a position, as value times ten to the exponent: exact for all that has at most 17 digits.

    Returns value, exponent, whether it has a decimal point and no exponent, and the position after it; -1 there if
    it is no number.
    """
    long = at + 2 < len(raw) and raw[at] == LONG_MINUS[0] and raw[at + 1] == LONG_MINUS[1]
    long = long and raw[at + 2] == LONG_MINUS[2]
    negative = raw[at] == MINUS or long
    start = at + (3 if long else 1) if negative or raw[at] == PLUS else at
    value, dropped, at = digits(raw, start, np.int64(0), 0)
    count, exponent, point = at - start, dropped, False
    if at < len(raw) and raw[at] == DOT:
        point = True
        first = at + 1
        value, dropped, at = digits(raw, first, value, 0)
        count += at - first
        exponent -= at - first - dropped
    if count == 0:
        return value, 0, False, -1
    if at < len(raw) and (raw[at] == LOWER_E or raw[at] == UPPER_E):
        point = False
        minus = at + 1 < len(raw) and raw[at + 1] == MINUS
        first = at + 2 if at + 1 < len(raw) and (minus or raw[at + 1] == PLUS) else at + 1
        power, _, at = digits(raw, first, np.int64(0), 0)
        if at == first:
            return value, 0, False, -1
        exponent += -power if minus else power
    return -value if negative else value, exponent, point, at


@njit(nogil=True, error_model="numpy")
def scaled(value, exponent):
    """value * 10**exponent, rounded to the nearest whole number, and whether it was whole; NO_TIME if too large."""
    if exponent == 0:
        return value, True
    if exponent > 0:
        power = POWERS[min(exponent, 18)]
        too_large = abs(value) > MOST_US // power or (exponent > 18 and value != 0)
        return (NO_TIME, False) if too_large else (value * power, True)
    if exponent < -18:
        return np.int64(0), value == 0
    unit = POWERS[-exponent]
    whole = (value + unit // 2) // unit
    return whole, whole * unit == value


@njit(nogil=True, error_model="numpy")
def word(raw, at):
    """1 or 0 for True or False, ON or OFF, in any case, -1 for another word, and the position after it."""
    start = at
    while raw[at] != NEWLINE and not is_blank(raw[at]):
        at += 1
    for truth, name in ((1, TRUE), (0, FALSE), (1, ON), (0, OFF)):
        if at - start == len(name):
            same = True
            for k in range(len(name)):
                same &= raw[start + k] | 32 == name[k]
            if same:
                return truth, at
    return -1, at


@njit(nogil=True, error_model="numpy")
def line_values(raw, at, roles, values, exponents):
    """The numbers of one line of any form into `values` and `exponents`, by their roles.

    Returns how many columns there are (0: blank or a comment, -1: not as many as roles, or no numbers), whether the
    time has a decimal point, and where the next line begins.
    """
    found, dotted = 0, False
    while raw[at] != NEWLINE:
        if is_blank(raw[at]):
            at += 1
            continue
        if found == 0 and (raw[at] == HASH or raw[at] == PERCENT):
            break
        if found == len(roles):
            found = -1
            break
        role = roles[found]
        value, exponent, point, after = number(raw, at)
        if after < 0 or (raw[after] != NEWLINE and not is_blank(raw[after])):
            value, after = word(raw, at)
            exponent = 0
            if value < 0 and role != SKIPPED:
                found = -1
                break
        values[role], exponents[role] = value, exponent
        dotted = point if role == T else dotted
        found += 1
        at = after
    while raw[at] != NEWLINE:
        at += 1
    return found if found in (0, len(roles)) else -1, dotted, at + 1


@njit(nogil=True, error_model="numpy")
def any_line(raw, at, roles, power, values, counts):
    """The event of a line of any form into `values`; whether there is one, and where the next line begins."""
    exponents = np.zeros(5, np.int64)
    found, dotted, after = line_values(raw, at, roles, values, exponents)
    if found == 0:
        return False, after
    column, column_whole = scaled(values[X], exponents[X])
    row, row_whole = scaled(values[Y], exponents[Y])
    sign, sign_whole = scaled(values[P], exponents[P])
    if found < 0 or not (sign_whole and -1 <= sign <= 1):
        counts[FIRST_BAD] = at if counts[BAD] == 0 else counts[FIRST_BAD]
        counts[BAD] += 1
        return False, after
    counts[FRACTIONS] += dotted or (exponents[T] < 0 and not scaled(values[T], exponents[T])[1])
    counts[ROUNDED] += not (column_whole and row_whole)
    values[T] = scaled(values[T], exponents[T] + power)[0]
    values[X] = column if 0 <= column < OUTSIDE else OUTSIDE
    values[Y] = row if 0 <= row < OUTSIDE else OUTSIDE
    values[P] = sign
    return True, after


@njit(nogil=True, error_model="numpy", inline="always")
def digit_at(raw, at):
    """The digit at a position; above 9 if there is none."""
    return np.uint8(raw[at] - np.uint8(ZERO))


@njit(nogil=True, error_model="numpy", inline="always")
def decimals(raw, at, value, power):
    """A value with the digits after its decimal point, as far as whole µs go, the next one rounded; and the position.

    Each of the `power` places that the unit has before the µs is filled, with zeros where digits are missing.
    """
    left, digit = power, digit_at(raw, at)
    while digit <= 9 and left > 0:
        value = value * 10 + np.int64(digit)
        left -= 1
        at += ONE
        digit = digit_at(raw, at)
    if digit <= 9:
        value += digit >= 5
    while digit <= 9:
        at += ONE
        digit = digit_at(raw, at)
    while left > 0:
        value *= 10
        left -= 1
    return value, at


@njit(nogil=True, error_model="numpy")
def plain_lines(raw, at, roles, power, events):
    """Events of lines of plain digits from a position on, into `events` (x, y, t, p), up to a line of another form.

    Returns how many there are, how many of their times have a decimal point, and where the other line begins.
    """
    x, y, t, p = events
    values, columns, count, dots = np.zeros(5, np.int64), len(roles), 0, 0
    while at < np.uintp(len(raw)):
        begin, good, dotted = at, True, False
        for column in range(columns):
            digit, start, value = digit_at(raw, at), at, np.int64(0)
            while digit <= 9:
                value = value * 10 + np.int64(digit)
                at += ONE
                digit = digit_at(raw, at)
            length, missing = np.int64(at - start), at == start
            if roles[column] == T:
                length += power
                dotted = raw[at] == DOT and power >= 0
                if dotted:
                    value, at = decimals(raw, at + ONE, value, power)
                elif power == -3:
                    value = (value + 500) // 1000  # a divisor that the compiler knows is not divided by
                else:
                    value *= POWERS[power]
            values[roles[column]] = value
            byte = raw[at]
            ends = byte in (NEWLINE, RETURN) if column == columns - 1 else byte in (SPACE, COMMA, TAB, SEMICOLON)
            if missing or length > LONGEST or value < 0 or not ends:
                good = False
                break
            at += ONE
        if good and raw[at - ONE] == RETURN:
            good = raw[at] == NEWLINE
            at += ONE
        if not good or values[P] > 1:
            return count, dots, begin
        x[count], y[count] = min(values[X], OUTSIDE), min(values[Y], OUTSIDE)
        t[count], p[count] = values[T], 2 * values[P] - 1
        dots, count = dots + dotted, count + 1
    return count, dots, at


@njit(nogil=True, error_model="numpy")
def parse_lines(raw, roles, power):
    """Events of whole lines, the last one with its newline; roles: what each column holds; power: of ten, to µs.

    Returns x, y, t in µs, p, and counts: of times with a decimal fraction, of events whose pixels were rounded, of
    lines that are no events, and where the first of them begins. Blank lines and comments are neither.
    """
    most = len(raw) // 8 + 2
    x, y = np.empty(most, np.uint16), np.empty(most, np.uint16)
    t, p = np.empty(most, np.int64), np.empty(most, np.int8)
    values, counts = np.zeros(5, np.int64), np.zeros(4, np.int64)
    count, at = 0, 0
    while at < len(raw):
        # Unsigned, as an index that may be negative costs a third of the speed.
        more, dots, reached = plain_lines(raw, np.uintp(at), roles, power, (x[count:], y[count:], t[count:], p[count:]))
        count, at = count + more, np.int64(reached)
        counts[FRACTIONS] += dots
        if at >= len(raw):
            break
        good, at = any_line(raw, at, roles, power, values, counts)
        if good:
            t[count], p[count] = values[T], 1 if values[P] > 0 else -1
            x[count], y[count] = values[X], values[Y]
            count += 1
    return x[:count], y[:count], t[:count], p[:count], counts
