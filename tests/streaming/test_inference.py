import hashlib
from pathlib import Path

import numpy as np
import onnx
import pytest

from evimo.errors import BadFile, NotFound
from evimo.streaming import inference
from evimo.streaming.inference import Network, presets


def test_answers_are_those_of_the_fake_network(fake_network):
    frames = np.zeros((5, 3, 6, 8), np.float32)
    frames[2, 0, 1, 3] = 2  # two ON events
    frames[2, 1, 4, 5] = 1
    frames[0, 0] = 15  # mean over the 15 frames: 1 everywhere, 15 / 15
    valid = np.ones((6, 8), np.float32)
    valid[4, 5] = 0
    answer = Network(fake_network).estimate(frames, valid=valid, intrinsics=np.array((1, 2, 3, 4), np.float32))
    assert np.argwhere(answer.moving).tolist() == [[1, 3]]
    assert answer.rel_depth[0, 0] == 2
    assert answer.rel_depth[1, 3] == pytest.approx(2 + 2 / 15)
    assert answer.velocity.shape == (3, 6, 8)
    assert answer.velocity[0, 1, 3] == 2
    assert answer.flow.shape == (2, 6, 8)
    assert answer.ego.tolist() == [1, 2, 3, 4, 5, 6]


def test_it_knows_its_file(fake_network):
    network = Network(fake_network)
    assert network.sha256 == hashlib.sha256(fake_network.read_bytes()).hexdigest()
    assert network.config == {"hidden": 8}
    network.check_size((100, 7))


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
    with pytest.raises(BadFile, match="lacks frames, valid"):
        Network(path)


def test_a_folder_is_not_found(tmp_path):
    with pytest.raises(NotFound):
        Network(tmp_path)


def test_a_model_of_fixed_size_says_so(tmp_path, fake_network):
    model = onnx.load(str(fake_network))
    for value in (*model.graph.input, *model.graph.output):
        for dimension in value.type.tensor_type.shape.dim:
            if dimension.dim_param:
                dimension.dim_value = {"h": 24, "w": 32}[dimension.dim_param]
    path = Path(tmp_path / "fixed.onnx")
    onnx.save(model, str(path))
    Network(path).check_size((24, 32))
    with pytest.raises(BadFile, match="32x24 only, not 346x260"):
        Network(path).check_size((260, 346))
