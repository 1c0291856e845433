import hashlib

import numpy as np
import onnx
import pytest

from evimo.errors import BadFile, NotFound
from evimo.streaming import inference
from evimo.streaming.inference import Network, presets


def test_answers_are_those_of_the_fake_network(fake_network):
    image = np.zeros((15, 6, 8), np.float32)
    image[4, 1, 3] = 2  # positive events of the middle slice
    image[5, 4, 5] = 1
    image[0] = 15  # 1 on average over the 15 channels
    valid = np.ones((6, 8), np.float32)
    valid[4, 5] = 0
    evidence = np.full((22, 3, 4), 0.5, np.float32)
    answer = Network(fake_network).estimate(image, evidence, valid=valid, intrinsics=np.array((1, 2, 3, 4), np.float32))
    assert np.argwhere(answer.moving).tolist() == [[1, 3]]
    assert answer.rel_depth[0, 0] == 2.5
    assert answer.rel_depth[1, 3] == pytest.approx(2.5 + 2 / 15)
    assert answer.velocity.shape == (3, 6, 8)
    assert answer.velocity[0, 1, 3] == 1
    assert answer.velocity[0, 4, 5] == -1
    assert answer.flow.shape == (2, 6, 8)
    assert answer.ego.tolist() == [1, 2, 3, 4, 5, 6]
    cropped = answer.cropped(2, 5)
    assert [each.shape for each in cropped] == [(2, 5), (2, 5), (6,), (3, 2, 5), (2, 2, 5)]
    assert np.argwhere(cropped.moving).tolist() == [[1, 3]]


def test_it_knows_its_file(fake_network):
    network = Network(fake_network)
    assert network.sha256 == hashlib.sha256(fake_network.read_bytes()).hexdigest()
    assert (network.config, network.stride, network.reduction) == ({"hidden": 8}, 4, 2)


@pytest.mark.parametrize(
    "facts", [{"config": "[]"}, {"config": "{"}, {"stride": "0"}, {"stride": "6"}, {"evidence_reduction": '"2"'}]
)
def test_a_file_that_does_not_say_how_its_images_are_made_is_refused(tmp_path, make_fake_network, facts):
    with pytest.raises(BadFile, match="does not say how its images are made"):
        Network(make_fake_network(tmp_path / "fake.onnx", **facts))


def test_presets_are_the_packaged_files(monkeypatch, tmp_path, fake_network):
    weights = tmp_path / "model" / "weights"
    weights.mkdir(parents=True)
    (weights / "small.onnx").write_bytes(fake_network.read_bytes())
    monkeypatch.setattr(inference, "files", lambda _: tmp_path)
    assert list(presets()) == ["small"]
    assert Network("small").config == {"hidden": 8}


def test_an_unknown_name_is_not_found():
    with pytest.raises(NotFound, match=r"no model 'enormous'") as raised:
        Network("enormous")
    assert "preset" in raised.value.fix


@pytest.mark.parametrize("content", [b"", b"hello", b"PK\x03\x04"])
def test_other_files_are_refused(tmp_path, content):
    path = tmp_path / "other.onnx"
    path.write_bytes(content)
    with pytest.raises(BadFile, match="not an ONNX model") as raised:
        Network(path)
    assert len(str(raised.value).splitlines()) == 2


def test_a_cut_file_is_refused(tmp_path, fake_network):
    path = tmp_path / "cut.onnx"
    path.write_bytes(fake_network.read_bytes()[:-100])
    with pytest.raises(BadFile):
        Network(path)


def test_another_network_is_refused(tmp_path):
    model = onnx.parser.parse_model(
        '<ir_version: 10, opset_import: ["": 18]> g (float[1] x) => (float[1] y) {y = Neg(x)}'
    )
    path = tmp_path / "neg.onnx"
    onnx.save(model, str(path))
    with pytest.raises(BadFile, match="lacks image, evidence, valid"):
        Network(path)


def test_a_folder_is_not_found(tmp_path):
    with pytest.raises(NotFound):
        Network(tmp_path)
