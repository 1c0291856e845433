import pytest
import torch

from evimo.errors import BadInput
from evimo.losses.total import total, weighted_total


def test_scales_count_by_their_pixels():
    assert weighted_total([torch.full((2, 1, 4, 4), 1.0), torch.full((2, 1, 2, 2), 6.0)]).item() == 2  # (32 + 48) / 40


def test_one_scale_is_its_mean():
    scale = torch.arange(6.0).view(1, 1, 2, 3)
    assert weighted_total([scale]) == scale.mean()


def test_gradient_of_every_pixel_is_the_same():
    scales = [torch.rand(1, 1, size, size, requires_grad=True) for size in (4, 2)]
    weighted_total(scales).backward()
    for scale in scales:
        assert scale.grad is not None
        torch.testing.assert_close(scale.grad, torch.full_like(scale, 1 / 20))


def test_terms_are_summed_by_weight():
    terms = {"depth": torch.tensor(2.0), "mask": torch.tensor(3.0), "warp": torch.tensor(float("nan"))}
    assert total(terms, {"depth": 0.5, "mask": 2.0, "warp": 0.0}).item() == 7


@pytest.mark.parametrize("weights", [{"depth": 1.0}, {"depth": 1.0, "mask": 1.0, "wrap": 1.0}])
def test_a_name_without_its_partner_is_an_error(weights):
    with pytest.raises(BadInput, match=r"mask|wrap"):
        total({"depth": torch.tensor(1.0), "mask": torch.tensor(1.0)}, weights)
