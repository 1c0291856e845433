import hashlib
import os
import shutil
import subprocess
import sys

import numpy as np
import onnx
import pytest

from evimo.errors import BadFile, NotFound
from evimo.streaming import graphs
from evimo.streaming.graphs import presets
from evimo.streaming.inference import CameraMotion, Network, Seen


def beside(path):
    return path.with_name(f"{path.stem}.first.onnx")


def seen(*, step=1, voxels=None):
    size = (12 // step, 16 // step)
    lens = np.array((1, 2, 3, 4), np.float32), np.zeros(4, np.float32)
    images = np.zeros((30, *size), np.float32) if voxels is None else voxels
    return Seen(images, np.full((24, 6, 8), 0.5, np.float32), np.ones((6, 8), np.float32), *lens)


def test_the_first_answer_is_that_of_the_fake_network(fake_network):
    voxels = np.full((30, 6, 8), 2, np.float32)
    motion = Network(fake_network).first(seen(step=2, voxels=voxels), np.zeros((22, 3, 4), np.float32))
    assert (motion.rel_depth == 2).all() and motion.rel_depth.shape == (3, 4)
    np.testing.assert_allclose(motion.ego, (0.04, 0, 0, 0, 0, 0), rtol=1e-6)
    assert (motion.flow[0] == 1).all() and not motion.flow[1].any()


def test_the_second_answer_is_that_of_the_fake_network(fake_network):
    voxels = np.zeros((30, 12, 16), np.float32)
    voxels[14, 2:4, 6:8] = 2  # positive events of the middle slice
    voxels[17, 8:10, 10:12] = 1
    voxels[0] = 30  # 1 on average over the 30 channels
    look = seen(voxels=voxels)
    look.valid[4, 5] = 0
    taken = CameraMotion(
        rel_depth=np.ones((3, 4), np.float32),
        ego=np.array((7, 0, 0, 0, 0, 0), np.float32),
        flow=np.full((2, 3, 4), 3, np.float32),
    )
    answer = Network(fake_network).second(look, taken)
    assert np.argwhere(answer.moving).tolist() == [[1, 3]]
    assert answer.rel_depth[0, 0] == 2.5
    assert answer.rel_depth[1, 3] == pytest.approx(2.5 + 2 / 30)
    assert answer.velocity.shape == (3, 6, 8)
    assert answer.velocity[0, 1, 3] == 1
    assert answer.velocity[0, 4, 5] == -1
    assert answer.flow.shape == (2, 6, 8)
    assert (answer.confidence[0, 0], answer.confidence[4, 5]) == (0.25, 0)
    assert answer.ego.tolist() == [1, 2, 3, 4, 7, 3]
    cropped = answer.cropped(2, 5)
    assert [each.shape for each in cropped] == [(2, 5), (2, 5), (6,), (3, 2, 5), (2, 2, 5), (2, 5)]
    assert np.argwhere(cropped.moving).tolist() == [[1, 3]]


def test_it_knows_its_files(fake_network):
    network = Network(fake_network)
    both = fake_network.read_bytes() + beside(fake_network).read_bytes()
    assert network.sha256 == hashlib.sha256(both).hexdigest()
    assert (network.config, network.stride) == ({"hidden": 8}, 8)


@pytest.mark.parametrize("facts", [{"config": "[]"}, {"config": "{"}, {"stride": "0"}, {"stride": "6"}])
def test_a_file_that_does_not_say_how_its_images_are_made_is_refused(tmp_path, make_fake_network, facts):
    with pytest.raises(BadFile, match="does not say how its images are made"):
        Network(make_fake_network(tmp_path / "fake.onnx", **facts))


def test_a_first_pass_that_is_missing_is_not_found(tmp_path, fake_network):
    shutil.copy(fake_network, tmp_path / "alone.onnx")
    with pytest.raises(NotFound, match="no first pass beside it") as raised:
        Network(tmp_path / "alone.onnx")
    assert "alone.first.onnx" in raised.value.fix


@pytest.mark.parametrize("other", [{"config": '{"hidden": 9}'}, {"stride": "16"}])
def test_a_first_pass_of_another_model_is_refused(tmp_path, make_fake_network, other):
    with pytest.raises(BadFile, match=r"fake\.first\.onnx is the first pass of another model"):
        Network(make_fake_network(tmp_path / "fake.onnx", first=other))


def test_exchanged_passes_are_refused(tmp_path, fake_network):
    shutil.copy(fake_network, tmp_path / "fake.first.onnx")
    shutil.copy(beside(fake_network), tmp_path / "fake.onnx")
    with pytest.raises(BadFile, match=r"fake\.onnx is not an evimo model: it lacks taken_ego"):
        Network(tmp_path / "fake.onnx")
    shutil.copy(fake_network, tmp_path / "fake.onnx")
    with pytest.raises(BadFile, match=r"fake\.first\.onnx is not an evimo model: it lacks candidates"):
        Network(tmp_path / "fake.onnx")


def test_presets_are_the_packaged_files(monkeypatch, tmp_path, fake_network):
    weights = tmp_path / "model" / "weights"
    weights.mkdir(parents=True)
    shutil.copy(fake_network, weights / "small.onnx")
    shutil.copy(beside(fake_network), weights / "small.first.onnx")
    monkeypatch.setattr(graphs, "files", lambda _: tmp_path)
    assert list(presets()) == ["small"]
    assert Network("small").config == {"hidden": 8}


def test_an_unknown_name_is_not_found():
    with pytest.raises(NotFound, match=r"no model 'enormous'") as raised:
        Network("enormous")
    assert "preset" in raised.value.fix


@pytest.mark.parametrize("which", ["other.onnx", "other.first.onnx"])
@pytest.mark.parametrize("content", [b"", b"hello", b"PK\x03\x04"])
def test_other_files_are_refused(tmp_path, fake_network, which, content):
    shutil.copy(fake_network, tmp_path / "other.onnx")
    shutil.copy(beside(fake_network), tmp_path / "other.first.onnx")
    (tmp_path / which).write_bytes(content)
    with pytest.raises(BadFile, match=f"{which} is not an ONNX model") as raised:
        Network(tmp_path / "other.onnx")
    assert len(str(raised.value).splitlines()) == 2


def test_a_cut_file_is_refused(tmp_path, fake_network):
    (tmp_path / "cut.onnx").write_bytes(fake_network.read_bytes()[:-100])
    shutil.copy(beside(fake_network), tmp_path / "cut.first.onnx")
    with pytest.raises(BadFile):
        Network(tmp_path / "cut.onnx")


def test_another_network_is_refused(tmp_path, fake_network):
    model = onnx.parser.parse_model(
        '<ir_version: 10, opset_import: ["": 18]> g (float[1] x) => (float[1] y) {y = Neg(x)}'
    )
    path = tmp_path / "neg.onnx"
    onnx.save(model, str(path))
    shutil.copy(beside(fake_network), beside(path))
    with pytest.raises(BadFile, match="lacks voxels, fits"):
        Network(path)


def test_a_folder_is_not_found(tmp_path):
    with pytest.raises(NotFound):
        Network(tmp_path)


def test_the_runtime_reports_nothing_to_its_makers():
    """Loaded without being told, it also complains where there is no home."""
    code = "import os, evimo.streaming.graphs as i; i._runtime(); print(os.environ['ORT_DISABLE_TELEMETRY'])"
    env = {name: value for name, value in os.environ.items() if name != "ORT_DISABLE_TELEMETRY"}
    env["HOME"] = "/nonexistent"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=env, check=True)
    assert (done.stdout, done.stderr) == ("1\n", "")
