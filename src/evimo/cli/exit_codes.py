"""What commands end with, beside 0."""

BUG = 1
WRONG_INPUT = 2  # and everything else that the user can change: a full disk, an output that nobody reads
DEFECTS = 3  # `check` has looked at everything, and found some
BY_SIGNAL = 128  # and the signal's number, as shells say: 130 after Ctrl-C, 143 after SIGTERM, 129 after SIGHUP
