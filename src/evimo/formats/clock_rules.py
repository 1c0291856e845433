"""The numbers by which a recording's clock is judged, apart from the compiled code, which takes long to load."""

WINDOW_US = 50_000  # simulators that write frame after frame leave the events of up to 40 ms unsorted
AHEAD = 64  # events that are asked where the clock jumps: fewer than half of them may be wrong
LONGEST_BLOCK = 8192  # events in a row, as of a message, that may be of another clock
LONG_US = 10_000_000  # a pause after which a handful of events is not believed at either end of a recording
NO_TIME = -(1 << 63)  # the time of an event that has none
MOST_US = 1 << 61  # sums of two times stay whole

KEPT, OUTLIER, LATE, AFTER_RESET, WAITING, ANEW = range(6)
NEWEST, OLDEST, ACCEPTED, DISORDERED, BACK_NEWEST, BACK_RUN, CUT = range(7)
