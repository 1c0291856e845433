"""H.264 video files."""

from collections.abc import Generator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Self

import av
import cv2
import numpy as np
from av.container import OutputContainer
from av.video.stream import VideoStream

from evimo.errors import BadInput
from evimo.viewing.colours import Image
from evimo.writing import new_file

_BT709, _BT601, _LIMITED = 1, 6, 1
"""Primaries and transfer of sRGB, the matrix of OpenCV's conversion, and its range, as H.264 numbers them."""


class VideoWriter:
    """Writes RGB images of one size as H.264, yuv420p, which every player shows.

    The file appears with the first image; folders are made. Close it, or use it in a `with` statement: an
    unclosed file cannot be played. After an error inside the statement the images so far are kept.

    Args:
        path: where to write, `.mp4` or `.mkv`.
        fps: images per second of playing time.
        crf: constant quality, 0 (lossless) to 51; 22 keeps thin lines and small letters clear.

    Raises:
        BadInput: fps is not positive, or the suffix names another kind of file.
    """

    def __init__(self, path: str | Path, *, fps: float, crf: int = 22) -> None:
        if not fps > 0:
            raise BadInput(f"a video of {fps} images per second cannot be played", fix="give a positive number")
        self.path = _video_path(path)
        self._fps = Fraction(fps).limit_denominator(1001)
        self._crf = crf
        self._opened: tuple[OutputContainer, VideoStream] | None = None

    def write(self, image: Image) -> None:
        """Append one image.

        Args:
            image: (h, w, 3) uint8 RGB, h and w even and the same for all.

        Raises:
            BadInput: the size is odd or differs from the first image's.
        """
        if self._opened is None:
            self._opened = self._open(image)
        container, stream = self._opened
        if image.shape != (stream.height, stream.width, 3):
            wanted = f"{stream.width}x{stream.height}"
            raise BadInput(
                f"an image of {image.shape[1]}x{image.shape[0]} px in a video of {wanted} px",
                fix="one VideoWriter for each size",
            )
        # six times faster than PyAV's own conversion
        planes = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2YUV_I420), np.uint8)
        frame = av.VideoFrame.from_ndarray(planes, format="yuv420p")
        container.mux(stream.encode(frame))  # pyright: ignore[reportUnknownMemberType]

    def close(self) -> None:
        """Finish the file; nothing happens without images, or the second time."""
        if self._opened is None:
            return
        container, stream = self._opened
        self._opened = None
        container.mux(stream.encode(None))  # pyright: ignore[reportUnknownMemberType]
        container.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _open(self, image: Image) -> tuple[OutputContainer, VideoStream]:
        height, width = image.shape[:2]
        if height % 2 or width % 2:
            raise BadInput(
                f"a video of {width}x{height} px", fix="an even width and an even height: H.264 halves its colours"
            )
        self.path.parent.mkdir(parents=True, exist_ok=True)
        container = av.open(str(self.path), "w")
        stream = container.add_stream("libx264", rate=self._fps)  # pyright: ignore[reportUnknownMemberType]
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        stream.options = {"crf": str(self._crf), "preset": "superfast"}
        context = stream.codec_context
        context.color_primaries = context.color_trc = _BT709
        context.colorspace, context.color_range = _BT601, _LIMITED
        return container, stream


@contextmanager
def whole_video(path: str | Path, *, fps: float) -> Generator[VideoWriter]:
    """A video that appears under its name when the `with` ends without an error, and else not at all.

    At least one image must be written. path, fps: as for `VideoWriter`.

    Raises:
        BadInput: as `VideoWriter`; or the file cannot be written, or the disk is full.
    """
    with new_file(_video_path(path)) as unfinished, VideoWriter(unfinished, fps=fps) as video:
        yield video


def _video_path(path: str | Path) -> Path:
    path = Path(path)
    if path.suffix.lower() not in (".mp4", ".mkv"):
        raise BadInput(f"{path.name} is no name of a video", fix="end it with .mp4 or .mkv")
    return path
