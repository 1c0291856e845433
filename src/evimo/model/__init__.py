"""The paper's two networks and what joins them: the events of five slices in, depth, egomotion and mixture out.

`presets` and `weights` need no torch; the rest is for training and export.
"""
