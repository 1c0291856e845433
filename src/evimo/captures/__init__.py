"""This room reads captures: a recording, the poses of motion capture, scans of objects and room, and how they fit.

One file, `capture.yaml` (docs/captures.md), says which files belong together.
"""
