"""The names of everything that a window shows; a path in Rerun is a place in this tree."""

WORLD = "world"
CAMERA = f"{WORLD}/camera"
IMAGE = f"{CAMERA}/image"
ROOM, SCANNED_ROOM = f"{WORLD}/room", f"{WORLD}/scan"
MARKERS = f"{WORLD}/markers"
TRAJECTORIES = f"{WORLD}/trajectories"
OBJECTS = f"{WORLD}/objects"

EVENTS = f"{IMAGE}/events"
TRUE_IDS, TRUE_DEPTH = f"{IMAGE}/truth/objects", f"{IMAGE}/truth/depth"
IDS, DEPTH = f"{IMAGE}/estimate/objects", f"{IMAGE}/estimate/depth"
UNKNOWN = "unknown"
"""Below a map of depths: where it says nothing."""

TRUE_POINTS, TRUE_VELOCITIES = f"{CAMERA}/truth/points", f"{CAMERA}/truth/velocities"
POINTS, VELOCITIES = f"{CAMERA}/estimate/points", f"{CAMERA}/estimate/velocities"

TRANSLATION, ROTATION, OBJECT_SPEEDS = "speeds/translation", "speeds/rotation", "speeds/objects"
TRUTH, ESTIMATE = "truth", "estimate"
"""Whose a curve of the plots is: `speeds/rotation/truth`."""
