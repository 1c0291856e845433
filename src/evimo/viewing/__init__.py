"""This room draws estimates and truth as pictures and videos, with NumPy and OpenCV alone.

`Panels` turns one `Estimate` and the events of its slice into one RGB frame with legends; `VideoWriter` and
`save_picture` write such frames to disk. The room draws arrays and knows no model.
"""
