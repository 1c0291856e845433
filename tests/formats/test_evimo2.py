import json

import numpy as np
import pytest

from evimo.errors import BadFile, EvimoWarning
from evimo.formats import evimo2, open_events


@pytest.fixture
def folder(tmp_path, events):
    write(tmp_path, events, "f8")
    np.savez_compressed(
        tmp_path / "dataset_depth.npz", **{f"depth_{k:010d}": np.zeros((48, 64), np.uint16) for k in (0, 2)}
    )
    return tmp_path


def write(folder, events, dtype):
    np.save(folder / "dataset_events_t.npy", (events.t / 1e6).astype(dtype))
    np.save(folder / "dataset_events_xy.npy", np.stack([events.x, events.y], axis=1))
    np.save(folder / "dataset_events_p.npy", (events.p > 0).astype(np.uint8))


@pytest.mark.parametrize("dtype", ["f4", "f8"])
def test_what_was_written_is_read(folder, events, rows, dtype):
    write(folder, events, dtype)
    opened = open_events(folder)
    assert (opened.sensor, opened.start_us, opened.stop_us) == ((48, 64), events.t[0], events.t[-1] + 1)
    assert rows(opened) == rows([events])
    assert opened.contents["depth maps"] == "2"


def test_packets_of_any_size_and_any_file_of_the_folder_give_the_same(folder, events, rows, monkeypatch):
    monkeypatch.setattr(evimo2, "PACKET_EVENTS", 13)
    opened = open_events(folder / "dataset_events_t.npy")
    assert rows(opened) == rows([events])
    assert rows(opened.packets(70_000, 130_000)) == rows([events.between(70_000, 130_000)])


def test_absolute_times_keep_their_microseconds(folder, events, rows):
    later = type(events)(events.x, events.y, events.t + 1_600_000_000_000_000, events.p)
    write(folder, later, "f8")
    assert rows(open_events(folder)) == rows([later])


def test_camera_comes_from_plain_sources_only(folder):
    matrix = np.array([[50.0, 0, 31], [0, 51, 23], [0, 0, 1]])
    np.savez(folder / "dataset_info.npz", K=matrix, meta=np.array({"pickled": 1}, dtype=object))
    found = open_events(folder).camera.camera
    assert (found.fx, found.cy, found.height) == (50, 23, 48)
    meta = {"fx": 40, "fy": 41, "cx": 30, "cy": 20, "k1": 0.1, "p2": 0.2, "res_x": 640, "res_y": 480}
    (folder / "dataset_info.json").write_text(json.dumps({"meta": meta}))
    opened = open_events(folder)
    assert opened.sensor == (480, 640)
    assert (opened.camera.camera.fx, opened.camera.camera.distortion) == (40, (0.1, 0, 0, 0.2, 0))


def test_without_maps_the_sensor_is_assumed(folder):
    (folder / "dataset_depth.npz").unlink()
    with pytest.warns(EvimoWarning, match="taken as 128x128"):
        assert open_events(folder).sensor == (128, 128)


@pytest.mark.parametrize("name", ["t", "xy", "p"])
def test_an_array_that_was_cut_short_is_used_with_a_warning(folder, events, rows, name):
    path = folder / f"dataset_events_{name}.npy"
    whole = path.read_bytes()
    path.write_bytes(whole[: 128 + (len(whole) - 128) // 2])
    with pytest.warns(EvimoWarning, match="the first 500 events are used"):
        assert rows(open_events(folder)) == rows([events.part(0, 500)])


def test_pickled_arrays_are_refused(folder):
    np.save(folder / "dataset_events_p.npy", np.array([{}, {}], dtype=object))
    with pytest.raises(BadFile, match="pickle"):
        open_events(folder)


def test_missing_damaged_and_empty_arrays_are_said(folder, events):
    (folder / "dataset_events_p.npy").unlink()
    with pytest.raises(BadFile, match=r"lacks dataset_events_p\.npy"):
        open_events(folder)
    write(folder, events.part(0, 0), "f8")
    with pytest.raises(BadFile, match="holds no events"):
        open_events(folder)
    (folder / "dataset_events_xy.npy").write_bytes(b"not an array")
    with pytest.raises(BadFile, match="no whole NumPy array"):
        open_events(folder)
