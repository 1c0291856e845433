"""What commands end with, beside 0."""

WRONG_INPUT = 2
INTERRUPTED = 130  # as shells say of Ctrl-C
