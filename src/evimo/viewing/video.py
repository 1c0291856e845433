"""H.264 video files."""

import os
from contextlib import suppress
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


class WholeVideo:
    """A video that appears under its name when it is complete, and else not at all.

    Used as a context: leaving it without `keep` leaves what was there before.

    Args:
        path, fps: as for `VideoWriter`.

    Raises:
        BadInput: as `VideoWriter`; or the file cannot be written (on entering), or its disk is full.
    """

    def __init__(self, path: str | Path, *, fps: float) -> None:
        self.path = _video_path(path)
        self._unfinished = self.path.with_name(f".{self.path.stem}.{os.getpid()}.unfinished{self.path.suffix}")
        self._writer = VideoWriter(self._unfinished, fps=fps)
        self._made = [folder for folder in self.path.parents if not folder.exists()]
        if self.path.is_dir():
            raise BadInput(f"{self.path} is a folder", fix="the name of a file that ends with .mp4")

    def write(self, image: Image) -> None:
        """Append one image; see `VideoWriter.write`."""
        try:
            self._writer.write(image)
        except OSError as error:
            raise self._unwritable(error) from error

    def keep(self) -> None:
        """Complete the file and give it its name; at least one image was written."""
        try:
            self._writer.close()
            os.replace(self._unfinished, self.path)
        except OSError as error:
            raise self._unwritable(error) from error

    def __enter__(self) -> Self:
        try:  # now rather than after a long way to the first image
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._unfinished.touch()
        except OSError as error:
            raise self._unwritable(error) from error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with suppress(OSError):  # a full disk, of which the user has heard
            self._writer.close()
        self._unfinished.unlink(missing_ok=True)
        for folder in self._made:
            with suppress(OSError):  # not empty
                folder.rmdir()

    def _unwritable(self, error: OSError) -> BadInput:
        return BadInput(
            f"cannot write {self.path}: {error.strerror}", fix="another --out file, or more room on the disk"
        )


def _video_path(path: str | Path) -> Path:
    path = Path(path)
    if path.suffix.lower() not in (".mp4", ".mkv"):
        raise BadInput(f"{path.name} is no name of a video", fix="end it with .mp4 or .mkv")
    return path
