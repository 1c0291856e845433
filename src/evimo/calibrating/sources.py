"""What a calibration with a target needs, from a capture or from a collected set."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from evimo.calibrating.board import calibrate_with_board, find_corners
from evimo.calibrating.bodies import markers_on_body, poses_of
from evimo.calibrating.collected import load_collected
from evimo.calibrating.event_images import brightness, count_images
from evimo.calibrating.fitting import Fit, Free
from evimo.calibrating.lights import find_spots
from evimo.calibrating.matching import match_markers
from evimo.calibrating.sightings import Mocap, Sightings
from evimo.calibrating.targets import BoardTarget, WandTarget, load_target
from evimo.calibrating.wand import Wand, calibrate_with_wand
from evimo.captures.capture import Capture, open_capture
from evimo.errors import BadInput, NotFound
from evimo.geometry.calibration import load_camera
from evimo.geometry.camera import ASSUMED_FOCAL, Camera, Lens

F8 = NDArray[np.float64]

LEAST_DEVIATION_M = 0.0005  # of where a wand's lights are: their bodies are larger
MARKERS_M = 0.005  # between a wand's markers in its file and in motion capture: other balls, another program


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """Sightings of a target, and what is known before.

    folder, name: where they are from, for files and messages.
    found:        of each image, spots (N, 2) of a wand, or corners of a board or None, px.
    times_us:     (F,) of the images, camera's clock.
    target:       the wand on its body, or the board.
    camera:       its intrinsics, or a guess. free: what is fitted.
    capture:      the capture.yaml that reads the result. offset_us: that it has. before: its body_from_cam.
    """

    folder: Path
    name: str
    found: Sequence[F8 | None]
    times_us: F8
    target: Wand | BoardTarget
    mocap: Mocap
    camera: Camera
    free: Free
    capture: Path | None = None
    offset_us: float = 0.0
    before: F8 | None = None

    def fit(self, *, search_us: float) -> tuple[Fit, Sightings]:
        """The calibration, and the sightings it was fitted to.

        Raises:
            BadInput: the target was seen too little, or nothing fits.
        """
        if isinstance(self.target, BoardTarget):
            return calibrate_with_board(
                self.found, self.times_us, self.target, self.mocap,
                start=self.camera, free=self.free, search_us=search_us,
            )  # fmt: skip
        spots = [np.zeros((0, 2)) if each is None else each for each in self.found]
        return calibrate_with_wand(
            spots, self.times_us, self.target, self.mocap, start=self.camera, free=self.free, search_us=search_us
        )


def collected_source(folder: Path, target: Path, *, camera: str | None, calibration: Path | None, lens: Lens) -> Source:
    """Images and poses collected together; their clocks are one.

    Raises:
        NotFound, BadFile, BadInput: something is missing or damaged.
    """
    wanted, collected = load_target(target), load_collected(folder, camera)
    found: list[F8 | None] = []
    size = (0, 0)
    for image in collected.brightness():
        if size not in ((0, 0), image.shape):
            raise BadInput(f"{folder} has images of several sizes", fix="images of one camera")
        size = image.shape
        found.append(find_corners(image, wanted) if isinstance(wanted, BoardTarget) else find_spots(image))
    given = None if calibration is None else load_camera(calibration, size=size, topic=f"/{camera}/events")
    return Source(
        folder=folder,
        name=f"{folder.name}, {camera}" if camera else folder.name,
        found=found,
        times_us=collected.times_us,
        target=_on_body(wanted, collected.markers),
        mocap=collected.mocap(),
        camera=given or _guessed(size, lens),
        free=Free(intrinsics=given is None, lens=given is None, clock=False),
    )


def captured_source(path: Path, target: Path, *, lens: Lens, window_us: int, every_us: int) -> Source:
    """A capture whose events show the target.

    Raises:
        NotFound, BadFile, BadInput: something is missing or damaged.
    """
    wanted, capture = load_target(target), open_capture(path)
    body = wanted.body or _only_body(capture, target)
    events = capture.recording.opened()
    times_us: list[float] = []
    found: list[F8 | None] = []
    for time_us, counts in count_images(events, events.sensor, window_us=window_us, every_us=every_us):
        times_us.append(time_us)
        found.append(_found(counts, wanted))
    tracks = capture.tracks(body)
    markers = np.zeros((0, 3))
    if isinstance(wanted, WandTarget) and wanted.markers is not None:
        seen = capture.marker_tracks()
        if body not in seen:
            raise NotFound(f"{capture.path}: no markers of {body}", fix="`mocap: {markers: [FILE]}`")
        _, markers = markers_on_body(tracks[body], seen[body])
    has_lens = capture.camera.intrinsics is not None or events.camera is not None
    return Source(
        folder=capture.path.parent,
        name=str(capture.path),
        found=found,
        times_us=np.array(times_us),
        target=_on_body(wanted, markers),
        mocap=Mocap(poses_of(tracks[capture.camera.body]), poses_of(tracks[body])),
        camera=capture.lens(events) if has_lens else _guessed(events.sensor, lens),
        free=Free(intrinsics=not has_lens, lens=not has_lens),
        capture=capture.path,
        offset_us=capture.offset_us,
        before=capture.camera.body_from_cam,
    )


def _found(counts: F8, wanted: WandTarget | BoardTarget) -> F8 | None:
    full = brightness(counts)
    if isinstance(wanted, WandTarget):
        return find_spots(counts, brightest=full)
    smooth = cv2.GaussianBlur(np.clip(255 * counts / full, 0, 255).astype(np.uint8), (3, 3), 0)
    return find_corners(smooth.astype(np.uint8), wanted)


def _only_body(capture: Capture, target: Path) -> str:
    """The body that has markers and is not the rig, where the target's file names none."""
    others = [body for body in capture.marker_tracks() if body != capture.camera.body]
    if len(others) != 1:
        raise BadInput(f"{target} names no body", fix=f"`body: NAME` in it, one of {', '.join(others)}")
    return others[0]


def _on_body(wanted: WandTarget | BoardTarget, markers: F8) -> Wand | BoardTarget:
    """A wand with the pose of its lights on its body."""
    if isinstance(wanted, BoardTarget):
        return wanted
    if wanted.markers is None:
        return Wand(lights=wanted.lights, body_from_lights=np.eye(4), deviation_m=LEAST_DEVIATION_M)
    match = match_markers(wanted.markers, markers, tolerance=MARKERS_M)
    deviation_m = max(match.rms, LEAST_DEVIATION_M)
    return Wand(lights=wanted.lights, body_from_lights=match.body_from_scan, deviation_m=deviation_m)


def _guessed(size: tuple[int, int], lens: Lens) -> Camera:
    """A start for intrinsics that are fitted."""
    height, width = size
    focal_px = ASSUMED_FOCAL * width
    return Camera(focal_px, focal_px, (width - 1) / 2, (height - 1) / 2, height, width, (0.0,) * 4, lens)
