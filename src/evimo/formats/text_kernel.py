# pyright: basic
"""Parsing of text lines with four numbers, compiled."""

import numpy as np

from evimo.compiling import njit

NEWLINE, SPACE, TAB, RETURN, COMMA, SEMICOLON = 10, 32, 9, 13, 44, 59
MINUS, PLUS, DOT, ZERO, NINE, LOWER_E, UPPER_E = 45, 43, 46, 48, 57, 101, 69
HASH, PERCENT = 35, 37
OUTSIDE = 65535
POWERS = 10 ** np.arange(19, dtype=np.int64)


@njit(cache=True, nogil=True, error_model="numpy")
def is_blank(byte):
    """Whether a byte separates numbers of one line."""
    return byte in (SPACE, COMMA, TAB, SEMICOLON, RETURN)


@njit(cache=True, nogil=True, error_model="numpy")
def digits(raw, at, value, dropped):
    """Digits appended to a value of at most 17 of them. Returns value, digits that did not fit, position after."""
    while at < len(raw) and ZERO <= raw[at] <= NINE:
        if value < 10**16:
            value = value * 10 + (raw[at] - ZERO)
        else:
            dropped += 1
        at += 1
    return value, dropped, at


@njit(cache=True, nogil=True, error_model="numpy")
def number(raw, at):
    """The number at a position, as value times ten to the exponent: exact for all that has at most 17 digits.

    Returns value, exponent, whether it has a decimal point and no exponent, and the position after it; -1 there if
    it is no number.
    """
    negative = raw[at] == MINUS
    start = at + 1 if negative or raw[at] == PLUS else at
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


@njit(cache=True, nogil=True, error_model="numpy")
def scaled(value, exponent):
    """value * 10**exponent, rounded to the nearest whole number, and whether it was whole."""
    if exponent == 0:
        return value, True
    if exponent > 0:
        return value * POWERS[min(exponent, 18)], True
    if exponent < -18:
        return np.int64(0), value == 0
    unit = POWERS[-exponent]
    whole = (value + unit // 2) // unit
    return whole, whole * unit == value


@njit(cache=True, nogil=True, error_model="numpy")
def line_numbers(raw, at, values, exponents, watched):
    """The numbers of one line into `values` and `exponents`.

    Returns how many there are (0: blank or a comment, -1: not as many as there is room for, or no numbers), whether
    the watched one has a decimal point, and where the next line begins.
    """
    found, dotted = 0, False
    while at < len(raw) and raw[at] != NEWLINE:
        if is_blank(raw[at]):
            at += 1
            continue
        if found == 0 and (raw[at] == HASH or raw[at] == PERCENT):
            break
        if found == len(values):
            found = -1
            break
        values[found], exponents[found], point, after = number(raw, at)
        if after < 0 or (after < len(raw) and raw[after] != NEWLINE and not is_blank(raw[after])):
            found = -1
            break
        dotted = point if found == watched else dotted
        found += 1
        at = after
    while at < len(raw) and raw[at] != NEWLINE:
        at += 1
    return found if found in (0, len(values)) else -1, dotted, at + 1


@njit(cache=True, nogil=True, error_model="numpy")
def parse_lines(raw, columns, order, seconds):
    """Events of whole lines with `columns` numbers each; order: the columns of t, x, y, p.

    Returns x, y, t in µs, p; how many times have a decimal fraction; how many lines are no events, and where the
    first of them begins (-1: none). Blank lines and those that begin with # or % are neither.
    """
    most = len(raw) // 8 + 2
    x, y = np.empty(most, np.uint16), np.empty(most, np.uint16)
    t, p = np.empty(most, np.int64), np.empty(most, np.int8)
    values, exponents = np.zeros(columns, np.int64), np.zeros(columns, np.int64)
    at_t, at_x, at_y, at_p = order
    count, fractions, bad, first_bad, at = 0, 0, 0, -1, 0
    while at < len(raw):
        start = at
        found, dotted, at = line_numbers(raw, at, values, exponents, at_t)
        if found == 0:
            continue
        column, column_whole = scaled(values[at_x], exponents[at_x])
        row, row_whole = scaled(values[at_y], exponents[at_y])
        sign, sign_whole = scaled(values[at_p], exponents[at_p])
        if found < 0 or not (column_whole and row_whole and sign_whole and -1 <= sign <= 1):
            bad += 1
            first_bad = start if first_bad < 0 else first_bad
            continue
        if dotted or (exponents[at_t] < 0 and not scaled(values[at_t], exponents[at_t])[1]):
            fractions += 1
        t[count] = scaled(values[at_t], exponents[at_t] + (6 if seconds else 0))[0]
        x[count] = column if 0 <= column < OUTSIDE else OUTSIDE
        y[count] = row if 0 <= row < OUTSIDE else OUTSIDE
        p[count] = 1 if sign > 0 else -1
        count += 1
    return x[:count], y[:count], t[:count], p[:count], fractions, bad, first_bad
