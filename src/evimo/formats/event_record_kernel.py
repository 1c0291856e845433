# pyright: basic
"""Decoding of files whose events have a whole time each, compiled: DAT, AEDAT 3 and AEDAT 4."""

import numpy as np

from evimo.compiling import njit
from evimo.formats.clock_rules import NO_TIME

UNKNOWN = -1
PACKET_HEADER, POLARITY, FRAME, FRAME_HEADER = 28, 1, 2, 36
FAR_US = 1 << 29  # between two times of DAT: nine minutes
TOGETHER = 4096  # events whose times are looked at together
SOURCES, ALL = 1 << 16, -1  # cameras, by number
KINDS = 16  # kinds of AEDAT 3 packets that are counted
RECORD_BYTES = (8, 8, 0, 36, 48)  # of special, polarity, frame (any), IMU of 6 and of 9 axes
LONGEST_BYTES = 1 << 26


@njit(nogil=True)
def decode_dat(records, state, final, bits):
    """DAT events (N, 2) u4: time in µs, then column, row and polarity; state[0] is the time reached.

    `bits` are those of the column and of the row, and where the polarity is. Each time is the one nearest to that
    before it whose low 32 bits are as stored; the first is near the middle one of the first three. A time far from
    the one before it and from the next is passed over. Returns as `decode_evt2`.
    """
    count = len(records)
    x, y = np.empty(count, np.uint16), np.empty(count, np.uint16)
    t, p = np.empty(count, np.int64), np.empty(count, np.int8)
    columns, rows, sign = np.uint32(bits[0]), np.uint32(bits[1]), np.uint32(bits[2])
    of_column, of_row = (1 << columns) - 1, (1 << rows) - 1
    reached = state[0]
    if reached == NO_TIME and count:
        reached = np.int64(np.median(records[: min(count, 3), 0]))
    for first in range(0, count, TOGETHER):
        last = min(first + TOGETHER, count)
        if is_steady(records[first:last], reached):
            steadily(records[first:last], reached, t[first:last])
            reached = t[last - 1]
            continue
        for at in range(first, last):
            now = reached + np.int32(records[at, 0] - np.uint32(reached))
            if abs(now - reached) < FAR_US or (
                at + 1 < count and abs(np.int64(np.int32(records[at + 1, 0] - records[at, 0]))) < FAR_US
            ):
                reached = now
            t[at] = now + (np.int64(now < 0) << 32)
    for at in range(count):
        address = records[at, 1]
        x[at], y[at] = address & of_column, address >> columns & of_row
        p[at] = 2 * np.int8(address >> sign & 1) - 1
    state[0] = reached
    return x, y, t, p, count, 0


@njit(nogil=True)
def is_steady(records, reached):
    """Whether all times of DAT events follow the time reached, none of them far from it: as nearly always."""
    far = np.uint32(0)
    for at in range(len(records)):
        far |= records[at, 0] - np.uint32(reached)
    return reached >= 0 and far < FAR_US


@njit(nogil=True)
def steadily(records, reached, t):
    """The whole times of DAT events that are as `is_steady` says."""
    for at in range(len(records)):
        t[at] = reached + np.int64(records[at, 0] - np.uint32(reached))


@njit(nogil=True)
def decode_aedat4(records, columns, first):
    """AEDAT 4 events (N, 2) u8 into columns x y t p from number `first` on.

    A record has the time in µs, then from the lowest bits on column and row, and a byte of polarity.
    """
    x, y, t, p = columns
    for at in range(len(records)):
        packed, place = records[at, 1], first + at
        x[place], y[place], t[place] = packed, packed >> np.uint64(16), records[at, 0]
        p[place] = 2 * np.int8(np.uint8(packed >> np.uint64(32)) != 0) - 1


@njit(nogil=True)
def number(raw, at):
    """Four bytes, little end first."""
    return np.int64(raw[at]) | np.int64(raw[at + 1]) << 8 | np.int64(raw[at + 2]) << 16 | np.int64(raw[at + 3]) << 24


@njit(nogil=True)
def packet_bytes(raw, at):
    """The length of an AEDAT 3 packet with its header, by the header; 0 where there is none that can be."""
    kind, size, place = raw[at] | np.int64(raw[at + 1]) << 8, number(raw, at + 4), number(raw, at + 8)
    capacity, count, valid = number(raw, at + 16), number(raw, at + 20), number(raw, at + 24)
    if kind >= KINDS or not valid <= count == capacity or not 8 <= size <= LONGEST_BYTES or place + 4 > size:
        return 0
    if count == 0 or count * size > LONGEST_BYTES or (kind == FRAME and size < FRAME_HEADER):
        return 0
    if kind < len(RECORD_BYTES) and RECORD_BYTES[kind] not in (0, size):
        return 0
    return PACKET_HEADER + count * size


@njit(nogil=True)
def rounds(raw, at, until, before):
    """How often the times had wrapped, by a packet's header; as before where the next packet does not agree."""
    told = number(raw, at + 12)
    if before in (UNKNOWN, told) or until + PACKET_HEADER > len(raw):
        return told
    return told if packet_bytes(raw, until) == 0 or number(raw, until + 12) == told else before


@njit(nogil=True)
def decode_aedat3(raw, state, final, kinds, sources):
    """The valid polarity events of AEDAT 3 packets (u1); the events of each kind are counted in `kinds`.

    `sources` counts the polarity events of each camera; where its last number is one's, others' are left out.

    A packet's header tells what is in it and how often the events' 31 bits of time had wrapped. Where there is none,
    the next is sought, and what lies between is lost: eight bytes an event. The state is the bytes of the event that
    is half lost, and the wraps. Returns as `decode_evt2`.
    """
    most = len(raw) // 8
    x, y = np.empty(most, np.uint16), np.empty(most, np.uint16)
    t, p = np.empty(most, np.int64), np.empty(most, np.int8)
    at, count, skipped = 0, 0, state[0]
    while at + PACKET_HEADER <= len(raw):
        length = packet_bytes(raw, at)
        if length == 0:
            at, skipped = at + 1, skipped + 1
            continue
        until = at + length
        if until + PACKET_HEADER > len(raw) and not final:
            break
        until = min(until, len(raw))
        state[1] = rounds(raw, at, until, state[1])
        kind, round_us = raw[at], state[1] << 31
        held, source = (until - at - PACKET_HEADER) // number(raw, at + 4), raw[at + 2] | np.int64(raw[at + 3]) << 8
        kinds[kind] += held
        sources[source] += held * (kind == POLARITY)
        if kind == POLARITY and sources[SOURCES] in (ALL, source):
            whole = (until - at - PACKET_HEADER) // 8 * 8
            records = raw[at + PACKET_HEADER : at + PACKET_HEADER + whole].view(np.uint32)
            for record in range(0, len(records), 2):
                packed = records[record]
                x[count], y[count] = packed >> 17, packed >> 2 & 0x7FFF
                t[count] = round_us | np.int64(records[record + 1] & np.uint32(0x7FFFFFFF))
                p[count] = np.int8(packed & np.uint32(2)) - np.int8(1)
                count += packed & 1
        at = until
    lost = skipped // 8
    state[0] = skipped - 8 * lost
    return x[:count], y[:count], t[:count], p[:count], len(raw) if final else at, lost
