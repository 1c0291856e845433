"""Which views a window has and where: the world on the left, the camera's pictures on the right, speeds below."""

from dataclasses import dataclass
from typing import Any

from evimo.viewing.window.entities import (
    DEPTH,
    EVENTS,
    IDS,
    IMAGE,
    OBJECT_SPEEDS,
    ROOM,
    ROTATION,
    TRANSLATION,
    TRUE_DEPTH,
    TRUE_IDS,
    WORLD,
)
from evimo.viewing.window.store import TIME, installed_rerun

BACKGROUND = (11, 13, 17)


@dataclass(frozen=True, slots=True, kw_only=True)
class Content:
    """What a window has to show.

    events, truth, estimates: whether there are any.
    speed: of playing, 1 being real time.
    """

    events: bool
    truth: bool
    estimates: bool
    speed: float


def arrangement(content: Content) -> Any:
    """The views of a window, as Rerun's blueprint."""
    rrb: Any = installed_rerun().blueprint
    time = rrb.TimePanel(timeline=TIME, playback_speed=content.speed, state="collapsed")
    pictures = rrb.Grid(contents=_pictures(rrb, content), grid_columns=2 if content.truth and content.estimates else 1)
    if not (content.truth or content.estimates):
        return rrb.Blueprint(pictures, time, collapse_panels=True)
    scene = rrb.Vertical(_scene(rrb), rrb.Horizontal(contents=_plots(rrb)), row_shares=[3, 1])
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


def _scene(rrb: Any) -> Any:
    """The world; maps of depth stay out of it, since Rerun lifts them without the lens: points are lifted with it."""
    contents = [f"+ {WORLD}/**", f"- {TRUE_DEPTH}/**", f"- {DEPTH}/**"]
    whole = rrb.VisibleTimeRange(TIME, start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.infinite())
    return rrb.Spatial3DView(
        origin=WORLD,
        contents=contents,
        name="World",
        background=BACKGROUND,
        line_grid=False,
        overrides={ROOM: rrb.VisibleTimeRanges([whole])},
    )


def _plots(rrb: Any) -> list[Any]:
    names = {TRANSLATION: "Camera's speed", ROTATION: "Camera's rotation", OBJECT_SPEEDS: "Objects' speeds"}
    return [rrb.TimeSeriesView(origin=origin, name=name) for origin, name in names.items()]
