"""What an event is and how time is cut: readers, packets, slices and stacks.

NumPy and numba; times are int64 µs of the file's own clock, x is the column and y the row. This room knows nothing of
cameras: where an event lands in the rectified image, the caller says.
"""
