"""How far a camera's clock is from mocap's, before anything else is known of where the camera is."""

import numpy as np
from numpy.typing import NDArray

from evimo.calibrating.resection import fit_projection, projected
from evimo.calibrating.sightings import Mocap, Sightings
from evimo.errors import BadInput
from evimo.geometry.camera import Camera

F8 = NDArray[np.float64]

STEP_US = 10_000.0  # a wand at 1 m/s moves a few px meanwhile, from where least squares find on
ROUNDS = 6  # of fits, each to the better half of the points


def search_offset(sightings: Sightings, body_from_target: F8, mocap: Mocap, camera: Camera, search_us: float) -> float:
    """The offset under which one camera explains most sightings best: a camera's time is mocap's and this, µs.

    For every offset, the points of the target are where mocap had them then, and a projection is fitted to the better
    half of them. Lenses bend by less than a wrong offset moves.

    Raises:
        BadInput: at no offset does mocap know the target in enough images.
    """
    offsets = np.arange(-search_us, search_us + STEP_US / 2, STEP_US) if search_us else np.zeros(1)
    scores = np.array([_score(sightings, body_from_target, mocap, camera, at) for at in offsets])
    if not np.isfinite(scores).any():
        raise BadInput("mocap does not know the target at the images' times", fix="the right clock, or --search wider")
    return float(offsets[int(np.nanargmin(np.where(np.isfinite(scores), scores, np.nan)))])


def _score(sightings: Sightings, body_from_target: F8, mocap: Mocap, camera: Camera, offset_us: float) -> float:
    """The median error under an offset, px; infinite where half of the sightings cannot be placed."""
    rig_from_body, known = mocap.rig_from_target(sightings.times_us - offset_us)
    part = sightings.where(known[sightings.image])
    if len(part) < max(len(sightings) / 2, 24):
        return np.inf
    points, px = part.on_rig(rig_from_body @ body_from_target), camera.normalised(part.px)[0] * camera.fx
    best = np.arange(len(part))
    errors = np.zeros(len(part))
    for _ in range(ROUNDS):
        errors = np.linalg.norm(projected(fit_projection(points[best], px[best]), points) - px, axis=1)
        best = np.argsort(errors)[: max(12, len(part) * 3 // 4)]
    return float(np.median(errors))
