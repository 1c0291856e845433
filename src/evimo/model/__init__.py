"""This room holds the networks: the events of five slices go in, depth, egomotion and motion masks come out.

`presets` and `weights` need no torch; the rest is for training and export.
"""
