"""What an event is and how time is cut: readers, packets, slices, event frames and stacks.

NumPy and numba; times are int64 µs of the file's own clock, x is the column and y the row. This room knows nothing of
cameras: where an event lands in the rectified image is a table of positions that the caller passes in.
"""
