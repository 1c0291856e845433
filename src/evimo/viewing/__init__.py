"""Pictures and videos of estimates: pure drawing with NumPy and OpenCV.

`Panels` turns one `Estimate` and the events of its slice into one RGB frame with legends; `VideoWriter` and
`save_picture` write such frames to disk. The room draws arrays and knows no model.
"""
