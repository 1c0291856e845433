"""This room holds the geometry of one moving camera: pure formulas, without configuration and without networks.

Camera, calibration files and rectification are NumPy and OpenCV, because running a model needs them. Poses, motion
field and warping are torch, differentiable, and needed for training only. This room knows nothing of events.
"""
