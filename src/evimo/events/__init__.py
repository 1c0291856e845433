"""This room says what an event is and how time is cut into slices and stacks, and finds motion in events.

NumPy and numba; times are int64 µs of the file's own clock, x is the column and y the row. It reads no files, and where
an event lands in the rectified image the caller says.
"""
