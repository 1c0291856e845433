import cv2
import numpy as np
import pytest

from evimo.errors import BadFile, NotFound
from evimo.scene.textures.bank import DENSE_MIX, texture_bank
from evimo.scene.textures.natural import INSTALLED, TESTING, TRAINING, cut, installed, textures_of
from evimo.scene.textures.patterns import SIZE


@pytest.fixture
def folder(tmp_path):
    """Three pictures: two that go up and down in x, one noise; and a text."""
    wave = np.tile(np.abs(np.linspace(-255, 255, 200)), (150, 1)).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "a.png"), wave)
    cv2.imwrite(str(tmp_path / "b.JPG"), wave)
    cv2.imwrite(str(tmp_path / "c.jpeg"), np.random.default_rng(0).integers(0, 256, (60, 50, 3)).astype(np.uint8))
    (tmp_path / "notes.txt").write_text("no picture")
    return tmp_path


def test_parts_cut_from_different_photos_and_all_are_installed():
    assert not set(TRAINING) & set(TESTING)
    assert INSTALLED[0] == TRAINING
    for pool, names in INSTALLED.items():
        assert len(installed(pool)) == len(names)
        assert all(photo.min() >= 0 and photo.max() <= 1 and min(photo.shape) >= 256 for photo in installed(pool)[:5])


@pytest.mark.parametrize("seed", range(12))
def test_a_cut_tiles_and_has_full_range(seed):
    tile = cut(np.random.default_rng(seed), installed(0), (), SIZE)
    assert tile.shape == (SIZE, SIZE)
    assert tile.min() < 0.1
    assert tile.max() > 0.9
    for axis in (0, 1):
        steps = np.abs(np.diff(tile, axis=axis)).mean()
        seam = np.abs(np.take(tile, 0, axis) - np.take(tile, -1, axis)).mean()
        assert seam < 3 * steps + 0.02


def test_a_third_or_more_of_dense_textures_are_natural():
    assert 0.33 < DENSE_MIX.count("natural") / len(DENSE_MIX) < 0.46


def test_a_folder_gives_grey_pictures_by_name(folder):
    photos = textures_of(folder)
    assert [photo.shape for photo in photos] == [(150, 200), (150, 200), (60, 50)]
    assert photos[0][0, 0] == pytest.approx(1)
    assert photos[0][0, 100] == pytest.approx(0, abs=0.01)
    assert all(photo.dtype == np.float32 for photo in photos)


def test_photos_of_a_camera_are_shrunk_and_hidden_files_passed_over(tmp_path):
    cv2.imwrite(str(tmp_path / "large.jpg"), np.tile(np.uint8(np.linspace(0, 255, 3000)), (2000, 1)))
    (tmp_path / "._large.jpg").write_bytes(b"of another system")
    (tmp_path / "folder.png").mkdir()
    (photo,) = textures_of(tmp_path)
    assert photo.shape == (512, 768)
    assert photo[100] == pytest.approx(np.linspace(0, 1, 768), abs=0.02)


def test_no_folder_or_none_or_broken_pictures_say_so(tmp_path):
    with pytest.raises(NotFound, match="no folder"):
        textures_of(tmp_path / "missing")
    with pytest.raises(NotFound, match="there are no pictures"):
        textures_of(tmp_path)
    for content in (b"", b"\x89PNG broken"):
        (tmp_path / "bad.png").write_bytes(content)
        with pytest.raises(BadFile, match="no picture of at least"):
            textures_of(tmp_path)


def test_a_users_pictures_come_into_the_bank(folder):
    (folder / "c.jpeg").unlink()
    own = texture_bank(3, plain=1, dense=27, images=folder)
    levels = own.texels[: 28 * SIZE * SIZE].reshape(28, SIZE, SIZE)[1:]
    straight = [np.minimum(np.ptp(level, axis=0).mean(), np.ptp(level, axis=1).mean()) < 0.02 for level in levels]
    without = texture_bank(3, plain=1, dense=27).texels[: 28 * SIZE * SIZE].reshape(28, SIZE, SIZE)[1:]
    before = [np.minimum(np.ptp(level, axis=0).mean(), np.ptp(level, axis=1).mean()) < 0.02 for level in without]
    assert sum(straight) >= sum(before) + 2


def test_two_pools_share_no_picture_of_a_user(folder):
    """Waves in the first and third picture by name go to training, noise alone is for testing."""
    (folder / "c.jpeg").rename(folder / "aa.jpeg")
    banks = [texture_bank(0, plain=1, dense=26, pool=pool, images=folder).texels for pool in (1, 2)]
    levels = [bank[: 27 * SIZE * SIZE].reshape(27, SIZE, SIZE)[1:] for bank in banks]
    even = [sum(np.ptp(level, axis=k).mean() < 0.02 for level in each for k in (0, 1)) for each in levels]
    assert even[0] > even[1]
