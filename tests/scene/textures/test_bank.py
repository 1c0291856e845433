import numpy as np
import pytest

from evimo.scene.textures.bank import texture_bank
from evimo.scene.textures.patterns import DENSE, PLAIN, SIZE, texture


@pytest.mark.parametrize("kind", PLAIN + DENSE)
def test_a_pattern_is_a_share_and_dense_ones_have_edges(kind):
    pattern = texture(np.random.default_rng(1), kind)
    assert pattern.shape == (SIZE, SIZE)
    assert pattern.min() >= 0
    assert pattern.max() <= 1
    steps = np.abs(np.diff(pattern)).max()  # what a moving camera turns into events
    assert (steps > 0.03) == (kind in DENSE)


def test_each_level_halves_the_one_before(bank):
    count = len(bank.plain) + len(bank.dense)
    levels = np.split(bank.texels, bank.offsets[1:])
    for level, texels in enumerate(levels):
        side = SIZE >> level
        assert texels.size == count * side * side
        mean = texels.reshape(count, -1).mean(axis=1)
        np.testing.assert_allclose(mean, levels[0].reshape(count, -1).mean(axis=1), atol=1e-5)


def test_the_same_seed_paints_the_same(bank):
    texture_bank.cache_clear()
    np.testing.assert_array_equal(texture_bank(7, plain=2, dense=10).texels, bank.texels)
    assert not np.array_equal(texture_bank(8, plain=2, dense=10).texels, bank.texels)


def test_maps_come_on_top_of_what_a_bank_has(bank):
    more = texture_bank(7, plain=2, dense=10, maps=2)
    assert more.maps.tolist() == [12, 13]
    np.testing.assert_array_equal(more.texels[: 12 * SIZE * SIZE], bank.texels[: 12 * SIZE * SIZE])
    assert np.abs(np.diff(more.texels[12 * SIZE * SIZE : 13 * SIZE * SIZE])).max() > 0.1
