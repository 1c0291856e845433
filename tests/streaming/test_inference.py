import hashlib
import shutil

import numpy as np
import onnx
import pytest

from evimo.errors import BadFile, NotFound
from evimo.streaming import inference
from evimo.streaming.inference import CameraMotion, Network, Seen, presets

H, W = 6, 8  # of the answer


def seen_of(voxels, *, valid=None, rotation=(0, 0, 0, 0)) -> Seen:
    return Seen(
        voxels=voxels,
        fits=np.zeros((24, H, W), np.float32),
        valid=np.ones((H, W), np.float32) if valid is None else valid,
        intrinsics=np.array((1, 2, 3, 4), np.float32),
        rotation=np.array(rotation, np.float32),
    )


def taken_of(*, rel_depth=1.0, flow=0.0, rigid=0.0) -> CameraMotion:
    half = H // 2, W // 2
    return CameraMotion(
        np.full(half, rel_depth, np.float32),
        np.zeros(6, np.float32),
        np.full((2, *half), flow, np.float32),
        np.full((2, *half), rigid, np.float32),
    )


def beside(path):
    return path.with_name(f"{path.stem}.first.onnx")


def copied(path, folder, *, name="copy"):
    """Both files of a model in a folder, under another name."""
    shutil.copy(beside(path), folder / f"{name}.first.onnx")
    return shutil.copy(path, folder / f"{name}.onnx")


def test_the_first_pass_is_that_of_the_fake_network(fake_network):
    voxels = np.zeros((30, H, W), np.float32)
    voxels[29] = 15  # 0.5 on average over the 30 channels
    motion = Network(fake_network).first(seen_of(voxels), np.ones((22, H // 2, W // 2), np.float32))
    assert [each.shape for each in motion] == [(3, 4), (6,), (2, 3, 4), (2, 3, 4)]
    np.testing.assert_allclose(motion.ego, (0.005, 0, 0, 0, 0, 0), rtol=1e-6)
    assert (motion.rel_depth == 1).all() and not motion.flow.any() and not motion.rigid.any()


def test_the_second_pass_is_that_of_the_fake_network(fake_network):
    voxels = np.zeros((30, 2 * H, 2 * W), np.float32)
    voxels[14, 3, 7] = 2  # a positive event of the middle slice
    voxels[13, 8, 10] = 1
    voxels[11, 0, 0] = 9  # of another slice
    voxels[29] = 15  # 0.5 on average over the 30 channels
    valid = np.ones((H, W), np.float32)
    valid[4, 5] = 0
    seen = seen_of(voxels, valid=valid, rotation=(0.1, 0.2, 0.5, 1))
    answer = Network(fake_network).second(seen, taken_of(rel_depth=2, flow=0.5, rigid=0.25))
    assert np.argwhere(answer.moving).tolist() == [[1, 3]]
    assert answer.rel_depth[5, 0] == 2.5
    assert answer.rel_depth[1, 3] == pytest.approx(2.5 + 2 / 4 / 30)
    assert answer.velocity.shape == (3, H, W)
    assert answer.velocity[0, 1, 3] == 1
    assert answer.velocity[0, 4, 5] == -1
    assert answer.flow.shape == (2, H, W)
    assert (answer.flow[1] == 0.25).all()
    assert answer.ego.tolist() == [1, 2, 3, 4, 5.5, 7]
    cropped = answer.cropped(2, 5)
    assert [each.shape for each in cropped] == [(2, 5), (2, 5), (6,), (3, 2, 5), (2, 2, 5)]
    assert np.argwhere(cropped.moving).tolist() == [[1, 3]]


def test_it_knows_its_files(fake_network):
    network = Network(fake_network)
    content = fake_network.read_bytes() + beside(fake_network).read_bytes()
    assert network.sha256 == hashlib.sha256(content).hexdigest()
    assert (network.config, network.stride) == ({"hidden": 8}, 4)


@pytest.mark.parametrize("facts", [{"config": "[]"}, {"config": "{"}, {"stride": "0"}, {"stride": "6"}])
def test_a_file_that_does_not_say_how_its_images_are_made_is_refused(tmp_path, make_fake_network, facts):
    with pytest.raises(BadFile, match="does not say how its images are made"):
        Network(make_fake_network(tmp_path / "fake.onnx", **facts))


def test_presets_are_the_packaged_files_without_their_first_passes(monkeypatch, tmp_path, fake_network):
    weights = tmp_path / "model" / "weights"
    weights.mkdir(parents=True)
    copied(fake_network, weights, name="small")
    monkeypatch.setattr(inference, "files", lambda _: tmp_path)
    assert list(presets()) == ["small"]
    assert Network("small").config == {"hidden": 8}


def test_an_unknown_name_is_not_found():
    with pytest.raises(NotFound, match=r"no model 'enormous'") as raised:
        Network("enormous")
    assert "preset" in raised.value.fix


def test_a_model_without_its_first_pass_is_told_which_file_is_missing(fake_network, tmp_path):
    alone = shutil.copy(fake_network, tmp_path / "alone.onnx")
    with pytest.raises(NotFound, match="no first pass beside it") as raised:
        Network(alone)
    assert "alone.first.onnx" in raised.value.fix


@pytest.mark.parametrize("facts", [{"config": '{"hidden": 9}'}, {"stride": "8"}])
def test_the_first_pass_of_another_model_is_refused(fake_network, make_fake_network, tmp_path, facts):
    other = make_fake_network(tmp_path / "other.onnx", **facts)
    shutil.copy(fake_network, other)
    with pytest.raises(BadFile, match=r"other\.first\.onnx is the first pass of another model"):
        Network(other)


@pytest.mark.parametrize("content", [b"", b"hello", b"PK\x03\x04"])
def test_other_files_are_refused(tmp_path, content):
    path = tmp_path / "other.onnx"
    path.write_bytes(content)
    with pytest.raises(BadFile, match="not an ONNX model") as raised:
        Network(path)
    assert len(str(raised.value).splitlines()) == 2


@pytest.mark.parametrize("cut", ["copy.onnx", "copy.first.onnx"])
def test_a_cut_file_is_refused(tmp_path, fake_network, cut):
    path = copied(fake_network, tmp_path)
    (tmp_path / cut).write_bytes((tmp_path / cut).read_bytes()[:-100])
    with pytest.raises(BadFile, match=cut):
        Network(path)


@pytest.mark.parametrize("replaced", ["copy.onnx", "copy.first.onnx"])
def test_another_network_is_refused(tmp_path, fake_network, replaced):
    path = copied(fake_network, tmp_path)
    model = onnx.parser.parse_model(
        '<ir_version: 10, opset_import: ["": 18]> g (float[1] x) => (float[1] y) {y = Neg(x)}'
    )
    onnx.save(model, str(tmp_path / replaced))
    with pytest.raises(BadFile, match=f"{replaced} is not an evimo model: it lacks voxels, fits, "):
        Network(path)


def test_a_first_pass_alone_is_no_model(fake_network):
    with pytest.raises(BadFile, match="lacks taken_ego"):
        Network(beside(fake_network))


def test_a_folder_is_not_found(tmp_path):
    with pytest.raises(NotFound):
        Network(tmp_path)
