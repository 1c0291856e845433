import pytest

from evimo.model.networks import network_of
from evimo.model.presets import PRESETS


@pytest.mark.parametrize(("name", "published"), [("base", 2_263_209), ("tiny", 40_000), ("ecn", 150_000)])
def test_presets_have_the_published_number_of_parameters(name, published):
    ours = sum(parameter.numel() for parameter in network_of(PRESETS[name]).parameters())
    assert ours == pytest.approx(published, rel=0.15)


def test_small_lies_between():
    counts = {name: sum(p.numel() for p in network_of(config).parameters()) for name, config in PRESETS.items()}
    assert counts["tiny"] < counts["small"] < counts["base"]


@pytest.mark.parametrize("name", ["base", "small", "tiny"])
def test_every_scale_of_both_passes_is_an_exact_fraction_of_the_padded_image(name):
    config = PRESETS[name]
    assert config.stride % (2 * 2**config.layers) == 0
    assert config.stride % (4 * 2**config.first_layers) == 0
