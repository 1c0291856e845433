import pytest

from evimo.model.motion_net import MotionNet
from evimo.model.presets import PRESETS


@pytest.mark.parametrize(("name", "published"), [("base", 2_263_209), ("tiny", 40_000)])
def test_presets_have_the_published_number_of_parameters(name, published):
    ours = sum(parameter.numel() for parameter in MotionNet(PRESETS[name]).parameters())
    assert ours == pytest.approx(published, rel=0.15)


@pytest.mark.parametrize(("name", "stride", "steps"), [("base", 32, [16, 8, 4, 2]), ("tiny", 18, [6, 2])])
def test_every_scale_is_an_exact_fraction_of_the_padded_image(name, stride, steps):
    config = PRESETS[name]
    assert config.stride == stride
    assert config.steps == steps
    assert all(stride % step == 0 for step in steps)
    assert 2 * config.evidence_reduction in steps  # the evidence lies on the grid of one of the scales
