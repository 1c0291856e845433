"""The paper's rival: what each of its answers depends on, and the geometry between them."""

import os
import subprocess
import sys

import numpy as np
import pytest
import torch

from evimo.model.checkpoint import save_model
from evimo.model.ecn import Ecn
from evimo.model.export import ONLY_INPUTS, ONLY_OUTPUTS
from evimo.model.presets import EcnConfig
from evimo.streaming import one_look
from evimo.streaming.inference import Network, Seen
from evimo.streaming.models import model_of

EXPORT = """
import sys
from pathlib import Path
from evimo.model.checkpoint import load_model
from evimo.model.export import export
export(load_model(sys.argv[1]), Path(sys.argv[2]))
"""
MIDDLE = slice(12, 18)


def asked(model: Ecn, seen, **changed):
    seen = seen._replace(**changed)
    with torch.no_grad():
        return model(seen.voxels, seen.valid, seen.intrinsics)


def test_scales_run_from_coarse_to_half_of_what_it_sees(ecn, look):
    answers, trust = asked(ecn, look((64, 96)))
    assert [tuple(each.rel_depth.shape[-2:]) for each in answers] == [(2, 3), (4, 6), (8, 12), (16, 24)]
    assert all(each.flow.shape[-2:] == each.valid.shape[-2:] == each.rel_depth.shape[-2:] for each in answers)
    assert trust.shape == (1, 1, 16, 24)
    whole, trust = ecn.finest(*(getattr(look((64, 96)), name) for name in ONLY_INPUTS))
    assert whole.rel_depth.shape == trust.shape == (1, 1, 32, 48) and whole.flow.shape == (1, 2, 32, 48)


def test_depth_is_of_the_middle_slice_and_motion_of_all_five(ecn, look):
    seen = look((64, 96))
    before, _ = asked(ecn, seen)
    for first in (0, 6, 18, 24):
        other = seen.voxels.clone()
        other[:, first : first + 6] = 0
        after, _ = asked(ecn, seen, voxels=other)
        torch.testing.assert_close(after[-1].rel_depth, before[-1].rel_depth)
        assert not torch.allclose(after[-1].ego, before[-1].ego, atol=1e-6)
    other = seen.voxels.clone()
    other[:, MIDDLE] = 0
    assert not torch.allclose(asked(ecn, seen, voxels=other)[0][-1].rel_depth, before[-1].rel_depth, atol=1e-4)


def test_the_flow_is_that_of_a_camera_that_moves_before_the_depth(ecn, look):
    """Against the motion of points: each pixel's point is moved and projected again."""
    seen = look((64, 96))
    answers, _ = asked(ecn, seen)
    said = answers[-1]
    fx, fy, cx, cy = seen.intrinsics[0].double().tolist()
    rows, columns = np.mgrid[:16, :24]
    x, y = (4 * columns + 1.5 - cx) / fx, (4 * rows + 1.5 - cy) / fy
    points = said.rel_depth[0, 0].double().numpy() * np.stack((x, y, np.ones_like(x)))
    ego, little = said.ego[0].double().numpy(), 1e-5
    turning = np.cross(np.broadcast_to(ego[3:], (16, 24, 3)), np.moveaxis(points, 0, -1))
    moved = points - little * (ego[:3, None, None] + np.moveaxis(turning, -1, 0))
    flow = np.stack((fx * (moved[0] / moved[2] - x), fy * (moved[1] / moved[2] - y))) / little
    np.testing.assert_allclose(said.flow[0].numpy(), flow, atol=1e-3 * np.abs(flow).max())


def test_a_log_depth_that_drifts_changes_nothing(look):
    """Warping does not ask for its mean, so that nothing would stop the drift."""
    torch.manual_seed(0)
    model = Ecn(EcnConfig()).eval()
    seen = look((64, 96))
    seen.valid[..., :8, :] = 0
    before, _ = asked(model, seen)
    assert before[-1].rel_depth.std() > 1e-3
    with torch.no_grad():
        for head in model.depth_net.heads:
            head.bias += 50
    after, _ = asked(model, seen)
    for old, new in zip(before, after, strict=True):
        torch.testing.assert_close(new.rel_depth, old.rel_depth, atol=1e-3, rtol=1e-3)
        inside = old.rel_depth[old.valid > 0.999]
        assert inside.mean() == pytest.approx(1, abs=0.05)


def test_what_the_lens_does_not_see_has_no_vote(ecn, look):
    seen = look((64, 96))
    seen.valid[..., :16, :] = 0
    _, trust = asked(ecn, seen)
    assert not trust[..., :8, :].any() and (trust[..., 8:, :] > 0).all()


def test_twice_the_focal_length_is_half_the_motion(ecn, look):
    """Votes are image motions; with the same places on the plane Z = 1 the network sees the same."""
    seen = look((64, 96))
    votes = torch.ones(1, 6, 16, 24)
    near, far = (ecn._ego(votes, votes[:, :1], focal * seen.intrinsics) for focal in (1.0, 2.0))
    torch.testing.assert_close(near, 2 * far)
    mean_focal_px = seen.intrinsics[0, :2].mean()
    torch.testing.assert_close(near * mean_focal_px, torch.full((1, 6), 4.0), atol=1e-4, rtol=1e-4)


@pytest.fixture(scope="module")
def exported(ecn, tmp_path_factory):
    """The untrained rival as ONNX; exported in a process of its own, where nothing checks shapes while it traces."""
    folder = tmp_path_factory.mktemp("exported")
    save_model(ecn, folder / "ecn.safetensors")
    command = [sys.executable, "-c", EXPORT, str(folder / "ecn.safetensors"), str(folder / "ecn.onnx")]
    subprocess.run(command, check=True, env={**os.environ, "OMP_NUM_THREADS": "1"})
    return folder / "ecn.onnx"


@pytest.mark.parametrize("size", [(32, 64), (96, 64)])
def test_it_says_the_same_in_onnx_and_torch(size, ecn, exported, look):
    seen = look(size)
    seen.valid[..., :5, :] = 0
    network = model_of(exported)
    assert isinstance(network, one_look.OneLookNetwork) and not isinstance(network, Network)
    assert (EcnConfig(**network.config), network.stride) == (ecn.config, 32)
    feeds = [image[0].numpy() for image in (seen.voxels, seen.fits, seen.valid[0], seen.intrinsics, seen.rotation)]
    answer = network.only(Seen(*feeds))
    with torch.no_grad():
        said, trust = ecn.finest(seen.voxels, seen.valid, seen.intrinsics)
    per_second = 40 / seen.intrinsics[0, :2, None, None]
    expected = (said.rel_depth[0, 0], said.ego[0] * 40, said.flow[0] * per_second, trust[0, 0])
    for name, value in zip(ONLY_OUTPUTS, expected, strict=True):
        scale = 1 + value.abs().max().item()
        np.testing.assert_allclose(getattr(answer, name), value.numpy(), atol=2e-3 * scale, err_msg=name)
    assert answer.moving is None and answer.velocity is None


def test_it_is_one_file_and_running_names_things_as_export_does(exported):
    assert {path.name for path in exported.parent.iterdir()} == {"ecn.onnx", "ecn.safetensors"}
    assert (one_look.ONLY_INPUTS, one_look.ONLY_OUTPUTS) == (ONLY_INPUTS, ONLY_OUTPUTS)
