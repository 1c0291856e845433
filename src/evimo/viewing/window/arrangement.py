"""Which views a window has and where: the world on the left, the camera's pictures on the right, speeds below."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evimo.recordings.pose_track import PoseTrack
from evimo.viewing.window.entities import (
    DEPTH,
    EVENTS,
    IDS,
    IMAGE,
    OBJECT_SPEEDS,
    POINTS,
    ROOM,
    ROTATION,
    TRANSLATION,
    TRUE_DEPTH,
    TRUE_IDS,
    WORLD,
)
from evimo.viewing.window.store import TIME, installed_rerun

BACKGROUND = (11, 13, 17)
BEHIND_M, BESIDE_M, ABOVE_M, AHEAD_M = 0.9, 0.5, 0.7, 0.8


@dataclass(frozen=True, slots=True, kw_only=True)
class Content:
    """What a window has to show.

    events, truth, estimates: whether there are any.
    speed: of playing, 1 being real time.
    eye:    from where the world is seen at first, and what is looked at, (2, 3); None leaves that to Rerun.
    """

    events: bool
    truth: bool
    estimates: bool
    speed: float
    eye: NDArray[np.float64] | None = None


def eye_behind(track: PoseTrack) -> NDArray[np.float64] | None:
    """A place behind, above and beside the camera, and the middle of what it sees, (2, 3); the world's z is up."""
    known = track.world_from_cam[np.isfinite(track.world_from_cam).all(axis=(1, 2))]
    if not len(known):
        return None
    place, right, ahead = (known[:, :3, column].mean(axis=0) for column in (3, 0, 2))
    behind = place - BEHIND_M * ahead + BESIDE_M * right + (0, 0, ABOVE_M)
    return np.stack((behind, place + AHEAD_M * ahead))


def arrangement(content: Content) -> Any:
    """The views of a window, as Rerun's blueprint."""
    rrb: Any = installed_rerun().blueprint
    time = rrb.TimePanel(timeline=TIME, playback_speed=content.speed, state="collapsed")
    pictures = rrb.Grid(contents=_pictures(rrb, content), grid_columns=2 if content.truth and content.estimates else 1)
    if not (content.truth or content.estimates):
        return rrb.Blueprint(pictures, time, collapse_panels=True)
    scene = rrb.Vertical(_scene(rrb, content), rrb.Horizontal(contents=_plots(rrb)), row_shares=[3, 1])
    return rrb.Blueprint(rrb.Horizontal(scene, pictures, column_shares=[3, 2]), time, collapse_panels=True)


def _pictures(rrb: Any, content: Content) -> list[Any]:
    """One view for each kind of picture; truth beside estimates."""
    views: list[tuple[str, list[str]]] = []
    if content.truth:
        views.append(("Truth: objects", [EVENTS, TRUE_IDS]))
    if content.estimates:
        views.append(("Estimate: objects", [EVENTS, IDS]))
    if content.truth:
        views.append(("Truth: depth", [f"{TRUE_DEPTH}/**"]))
    if content.estimates:
        views.append(("Estimate: depth", [f"{DEPTH}/**"]))
    if not views:
        views.append(("Events", [EVENTS]))
    return [
        rrb.Spatial2DView(origin=IMAGE, contents=entities, name=name, background=BACKGROUND) for name, entities in views
    ]


def _scene(rrb: Any, content: Content) -> Any:
    """The world; maps of depth stay out of it, since Rerun lifts them without the lens: points are lifted with it."""
    contents = [f"+ {WORLD}/**", f"- {TRUE_DEPTH}/**", f"- {DEPTH}/**"]
    whole = rrb.VisibleTimeRange(TIME, start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.infinite())
    overrides: dict[str, Any] = {ROOM: rrb.VisibleTimeRanges([whole])}
    if content.truth:  # two clouds in one place hide each other
        overrides[POINTS] = rrb.EntityBehavior(visible=False)
    eye: dict[str, Any] = {}
    if content.eye is not None:
        eye["eye_controls"] = rrb.EyeControls3D(position=content.eye[0], look_target=content.eye[1], eye_up=(0, 0, 1))
    return rrb.Spatial3DView(
        origin=WORLD,
        contents=contents,
        name="World",
        background=BACKGROUND,
        line_grid=False,
        overrides=overrides,
        **eye,
    )


def _plots(rrb: Any) -> list[Any]:
    legend = rrb.PlotLegend(corner="lefttop")
    curves = {TRANSLATION: "Camera's speed", ROTATION: "Camera's rotation"}
    views = [rrb.TimeSeriesView(origin=origin, name=name, plot_legend=legend) for origin, name in curves.items()]
    of_objects = rrb.PlotLegend(visible=False)  # as many as a run has found; they have the colours of the masks
    return [*views, rrb.TimeSeriesView(origin=OBJECT_SPEEDS, name="Objects' speeds", plot_legend=of_objects)]
