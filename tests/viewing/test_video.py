from fractions import Fraction

import av
import numpy as np
import pytest

from evimo.errors import BadInput
from evimo.viewing.video import VideoWriter, whole_video

SIZE = (48, 64)
COLOURS = [(255, 104, 82), (76, 160, 255), (240, 228, 66), (11, 13, 17), (236, 239, 243)]


def plain(colour, size=SIZE):
    return np.full((*size, 3), colour, np.uint8)


def read(path):
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        rate, name, pixels = stream.average_rate, stream.codec_context.name, stream.codec_context.pix_fmt
        return rate, name, pixels, [frame.to_ndarray(format="rgb24") for frame in container.decode(stream)]


@pytest.mark.parametrize("suffix", ["mp4", "mkv"])
def test_what_was_written_is_read_back(tmp_path, suffix):
    path = tmp_path / "new" / f"video.{suffix}"
    with VideoWriter(path, fps=40) as video:
        for k in range(30):
            video.write(plain(COLOURS[k // 6]))
    rate, name, pixels, images = read(path)
    assert (rate, name, pixels, len(images)) == (40, "h264", "yuv420p", 30)
    for k, image in enumerate(images):
        assert image.shape == (*SIZE, 3)
        assert np.abs(image.astype(int) - COLOURS[k // 6]).max() <= 6


@pytest.mark.parametrize(("fps", "rate"), [(0.5, Fraction(1, 2)), (29.97002997, Fraction(30000, 1001)), (400, 400)])
def test_any_speed(tmp_path, fps, rate):
    with VideoWriter(tmp_path / "v.mp4", fps=fps) as video:
        for _ in range(5):
            video.write(plain(COLOURS[0]))
    assert float(read(tmp_path / "v.mp4")[0]) == pytest.approx(float(rate), rel=1e-4)


def test_images_before_an_error_are_kept(tmp_path):
    with pytest.raises(RuntimeError), VideoWriter(tmp_path / "v.mp4", fps=40) as video:
        for _ in range(7):
            video.write(plain(COLOURS[1]))
        raise RuntimeError
    assert len(read(tmp_path / "v.mp4")[3]) == 7


def test_no_image_no_file_and_closing_twice_is_harmless(tmp_path):
    video = VideoWriter(tmp_path / "v.mp4", fps=40)
    video.close()
    video.close()
    assert not (tmp_path / "v.mp4").exists()


def test_sizes_that_cannot_be_written_are_refused(tmp_path):
    with VideoWriter(tmp_path / "v.mp4", fps=40) as video:
        with pytest.raises(BadInput, match="64x49"):
            video.write(plain(COLOURS[0], (49, 64)))
        video.write(plain(COLOURS[0]))
        with pytest.raises(BadInput, match="64x50 px in a video of 64x48"):
            video.write(plain(COLOURS[0], (50, 64)))


@pytest.mark.parametrize(
    ("name", "fps"), [("v.mp4", 0), ("v.mp4", -1), ("v.mp4", float("nan")), ("v.txt", 40), ("v", 40)]
)
def test_bad_names_and_speeds_are_refused(tmp_path, name, fps):
    with pytest.raises(BadInput):
        VideoWriter(tmp_path / name, fps=fps)


def test_a_whole_video_appears_when_it_is_done(tmp_path):
    path = tmp_path / "new" / "v.mp4"
    with whole_video(path, fps=40) as video:
        for _ in range(3):
            video.write(plain(COLOURS[0]))
        assert not path.exists()
    assert len(read(path)[3]) == 3
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize("before", [True, False])
def test_an_error_changes_nothing(tmp_path, before):
    path = tmp_path / ("old" if before else "new") / "v.mp4"
    if before:
        path.parent.mkdir()
        path.write_bytes(b"old")
    there = sorted(tmp_path.rglob("*"))
    with pytest.raises(RuntimeError), whole_video(path, fps=40) as video:
        video.write(plain(COLOURS[0]))
        raise RuntimeError
    assert sorted(tmp_path.rglob("*")) == there
    assert not before or path.read_bytes() == b"old"


def test_names_that_cannot_be_written_are_refused(tmp_path):
    (tmp_path / "folder.mp4").mkdir()
    (tmp_path / "file").touch()
    for name, message in (("folder.mp4", "is a folder"), ("video.avi", r"video\.avi"), ("file/v.mp4", "cannot write")):
        with pytest.raises(BadInput, match=message), whole_video(tmp_path / name, fps=40):
            pass
