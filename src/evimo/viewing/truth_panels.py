"""One frame of what really happened: events, objects, depth, flow and motion of one slice of a recording with truth."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evimo.events.slices import Slice
from evimo.geometry.camera import Camera
from evimo.recordings.flow import true_flow
from evimo.recordings.truth import Truth
from evimo.viewing import legends
from evimo.viewing.colours import MUTED, Image
from evimo.viewing.frame import Frame
from evimo.viewing.history import History
from evimo.viewing.layout import Box
from evimo.viewing.maps import event_levels
from evimo.viewing.moment import Moment, true
from evimo.viewing.painter import Painter
from evimo.viewing.pixel_flow import PixelFlow
from evimo.viewing.strokes import text_width, write

WITH_INTENSITY: tuple[str, ...] = ("intensity", "events", "objects", "depth", "flow", "velocity")
WITHOUT_INTENSITY: tuple[str, ...] = ("events", "objects", "depth", "flow")
"""Here the arrows of velocity are drawn into `objects`."""

ARROWS = "id: speed, m/s"
SPACE = 12

FASTEST = 98
"""Percentile of the flow's speed from which on colours are pure."""


@dataclass(frozen=True, slots=True)
class TrueSlice:
    """What is known of one slice.

    part: its events. truth: of its middle. flow_px: (H, W, 2) px/s. light: (H, W) linear light, 1 is white, or None.
    """

    part: Slice
    truth: Truth
    moment: Moment
    flow_px: NDArray[np.float64]
    light: NDArray[np.float32] | None


class TruthReader:
    """Completes truth by what follows from it, for one camera."""

    def __init__(self, camera: Camera) -> None:
        self.flow = PixelFlow(camera)

    def slice(self, part: Slice, truth: Truth, light: NDArray[np.float32] | None = None) -> TrueSlice:
        """The slice with its objects and its flow."""
        flow_px = self.flow.px(true_flow(truth, self.flow.grid))
        return TrueSlice(part, truth, true(truth, part), flow_px, light)


class TruthPanels:
    """Draws the truth of one recording, slice after slice; it remembers two seconds of motion for plots and scales.

    Args:
        camera: of the sensor.
        bounds: nearest and farthest depth that colours tell apart, m; powers of two, as `depth_bounds` gives them.
        intensity: whether there are pictures too.
    """

    def __init__(self, camera: Camera, *, bounds: tuple[float, float], intensity: bool) -> None:
        self._names = WITH_INTENSITY if intensity else WITHOUT_INTENSITY
        self._frame = Frame(camera.size, rows=2, columns=len(self._names) // 2)
        self._reader, self._bounds = TruthReader(camera), bounds
        self._headers = dict(zip(self._names, self._frame.layout.headers, strict=True))
        truth_titles(self._frame.empty, self._headers, bounds=bounds)
        self._sidebar = self._frame.sidebar(unit="m/s", coloured="Flow and object velocity")
        self._history = History()

    def draw(
        self, part: Slice, truth: Truth, *, time_origin_us: int, light: NDArray[np.float32] | None = None
    ) -> Image:
        """Draw one slice.

        Args:
            part: its events.
            truth: of an instant in it.
            time_origin_us: absolute time shown as 0 s.
            light: (H, W) linear light, 1 is white, of the same instant; needed where `intensity` was said.

        Returns:
            (height, width, 3) uint8 RGB, a new array.

        Raises:
            BadInput: the maps have another size than the camera.
        """
        self._frame.check(truth.ids.shape)
        shown = self._reader.slice(part, truth, light)
        self._history.add(shown.moment, flow_px=flow_speed(shown))
        image, history = self._frame.empty.copy(), self._history
        panels = dict(zip(self._names, self._frame.panels(image), strict=True))
        limits = history.speed_limit, history.flow_limit
        paint_truth(self._frame.painter, panels, shown, bounds=self._bounds, limits=limits)
        legends.hint(image, self._headers["flow"], f"pure colour: {history.flow_limit:g} px/s and more")
        self._sidebar.draw(image, shown.moment, events=len(part.events), history=history, time_origin_us=time_origin_us)
        return image


def depth_bounds(truths: Iterable[Truth]) -> tuple[float, float]:
    """Powers of two, in m, that hold the depths of these instants but for the nearest and the farthest hundredth."""
    some = [np.percentile(truth.depth[truth.valid], (1, 99)) for truth in truths if truth.valid.any()]
    if not some:
        return 0.5, 8.0
    near, far = np.min(some, axis=0)[0], np.max(some, axis=0)[1]
    return float(2 ** np.floor(np.log2(near))), float(2 ** max(np.ceil(np.log2(far)), np.floor(np.log2(near)) + 1))


def flow_speed(shown: TrueSlice) -> float:
    """How fast the fast pixels are, px/s."""
    valid = shown.truth.valid
    return float(np.percentile(np.linalg.norm(shown.flow_px[valid], axis=-1), FASTEST)) if valid.any() else 0.0


def paint_truth(
    painter: Painter,
    panels: Mapping[str, Image],
    shown: TrueSlice,
    *,
    bounds: tuple[float, float],
    limits: tuple[float, float],
) -> None:
    """Paint the panels of these names, in place; limits: speeds of the longest arrow, m/s, and of pure flow, px/s."""
    truth, marks, valid = shown.truth, shown.moment.marks, shown.truth.valid
    levels = event_levels(shown.part.events, painter.zoom)
    for name, panel in panels.items():
        match name:
            case "intensity" if shown.light is not None:
                painter.intensity(panel, shown.light)
            case "events":
                painter.events(panel, levels)
            case "objects":
                painter.mask(panel, levels, ids=truth.ids, moving=truth.of_movers(truth.ids), valid=valid)
                painter.static(panel, truth.clutter)
                painter.outlines(panel, truth.ids, marks)
                if "velocity" in panels:
                    painter.labels(panel, marks)
                else:
                    painter.arrows(panel, marks, full=limits[0])
            case "depth":
                painter.depth(panel, truth.depth, valid=valid, bounds=bounds)
            case "flow":
                painter.flow(panel, shown.flow_px, valid=valid, full=limits[1])
            case "velocity":
                painter.velocity(panel, levels, marks, ids=truth.ids, valid=valid, full=limits[0])
            case _:
                raise ValueError(f"no panel {name!r} of this slice")


def truth_titles(image: Image, headers: Mapping[str, Box], *, bounds: tuple[float, float]) -> None:
    """Write the title bars of the panels of these names, in place; narrow ones leave out what labels mean."""
    titles = {
        "intensity": "Intensity",
        "events": "Events",
        "objects": "Objects",
        "depth": "Depth",
        "flow": "Flow",
        "velocity": "Object velocity",
    }
    ends = {name: legends.title(image, header, titles[name]) for name, header in headers.items()}
    legends.polarities(image, headers["events"])
    legend_start = legends.static(image, headers["objects"])
    legends.depths(image, headers["depth"], bounds=bounds, unit="m")
    if "intensity" in headers:
        legends.hint(image, headers["intensity"], "rendered again")
    if "velocity" in headers:
        legends.hint(image, headers["velocity"], ARROWS)
    elif ends["objects"] + text_width(ARROWS) + 2 * SPACE <= legend_start:
        write(image, ARROWS, (ends["objects"] + SPACE, headers["objects"].y + 16), colour=MUTED)
