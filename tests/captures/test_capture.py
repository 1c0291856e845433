"""capture.yaml: what it says is what is opened, and each mistake in it is named with its line."""

import numpy as np
import pytest

from evimo.captures.capture import open_capture
from evimo.captures.entries import load_entries, pose_words
from evimo.errors import BadFile, NotFound
from evimo.geometry.camera import Camera

GOOD = """\
recording: {file: events.txt, sensor: 64x48, time_unit: us}
mocap:
  files: [mocap.csv]
  offset_us: -1250
camera:
  body: Rig
  intrinsics: {fx: 50, fy: 51, cx: 31, cy: 23, height: 48, width: 64, distortion: [0.1, 0, 0, 0]}
  body_from_cam: {position: [0.1, 0.2, 0.3], quaternion: [0, 0, 0.70710678, 0.70710678]}
objects:
  car:
    id: 7
    body: Object_1
    scan: car.off
    unit: mm
room: {scan: car.off}
"""
CAR = "OFF\n4 4 6\n0 0 0\n100 0 0\n0 200 0\n0 0 300\n3 0 1 2\n3 0 2 3\n3 0 3 1\n3 1 3 2\n"


@pytest.fixture
def folder(tmp_path, poses):
    lines = ["t_us,body,x,y,z,qx,qy,qz,qw"]
    for body, (times_us, position, quaternion, _) in poses.items():
        lines += [",".join(map(str, [t, body, *p, *q])) for t, p, q in zip(times_us, position, quaternion, strict=True)]
    (tmp_path / "mocap.csv").write_text("\n".join(lines))
    (tmp_path / "events.txt").write_text("".join(f"{1000 * k} {k} {k} {k % 2}\n" for k in range(40)))
    (tmp_path / "car.off").write_text(CAR)
    (tmp_path / "capture.yaml").write_text(GOOD)
    return tmp_path


def test_a_capture_opens_what_it_names(folder, poses):
    capture = open_capture(folder)
    events = capture.recording.opened()
    assert (events.sensor, sum(map(len, events))) == ((48, 64), 40)
    assert capture.lens(events) == Camera(50.0, 51.0, 31.0, 23.0, 48, 64, (0.1, 0.0, 0.0, 0.0))
    np.testing.assert_allclose(capture.camera.body_from_cam @ [1, 0, 0, 1], [0.1, 1.2, 0.3, 1], atol=1e-7)
    tracks = capture.tracks()
    assert sorted(tracks) == ["Object_1", "Rig"]
    assert (tracks["Rig"].times_us == poses["Rig"][0] - 1250).all()
    (car,) = capture.objects
    assert (car.id, car.name, car.body_from_scan) == (7, "car", None)
    assert car.load().points.max() == pytest.approx(0.3)
    assert capture.room.load().points.max() == pytest.approx(300)
    np.testing.assert_array_equal(capture.room.world_from_scan, np.eye(4))


def test_a_bag_of_everything_needs_no_list_of_files(folder, poses, vicon_bag):
    bag = vicon_bag(folder / "all.bag", poses)
    (folder / "capture.yaml").write_text(f"recording: {bag.name}\ncamera: {{body: Rig}}\n")
    capture = open_capture(folder)
    assert capture.mocap == (bag,)


def test_files_of_tools_fill_in_and_never_overrule(folder):
    pose = np.eye(4)
    pose[:3, 3] = 1, 2, 3
    words = pose_words(pose)
    (folder / "found.yaml").write_text(f"objects:\n  car:\n    body_from_scan: {words}\n")
    (folder / "capture.yaml").write_text(GOOD + "calibration: found.yaml\n")
    np.testing.assert_allclose(open_capture(folder).objects[0].body_from_scan, pose)
    (folder / "found.yaml").write_text("# found\nmocap:\n  offset_us: 3\n")
    with pytest.raises(
        BadFile, match=r"found\.yaml, line 3: `mocap\.offset_us` stands here and in .*capture\.yaml, line 4"
    ):
        open_capture(folder)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("body: Rig", "bodi: Rig", r"line 6: `camera\.bodi` is no known key"),
        ("  body: Rig\n", "", r"line 5: `camera` lacks `body`"),
        ("id: 7", "id: 70", r"line 11: `objects\.car\.id` should be a whole number from 1 to 65"),
        ("offset_us: -1250", "offset_us: soon", r"line 4: `mocap\.offset_us` should be a number"),
        ("0.70710678]}", "0.9]}", r"line 8: .*quaternion` has length"),
        ("[0.1, 0.2, 0.3]", "[0.1, 0.2]", r"line 8: .*position` should be a list of 3 numbers"),
        ("unit: mm", "unit: inch", r"line 14: .*unit` is 'inch'"),
        ("fx: 50", "fx: -50", r"line 7: .*not a camera"),
        ("64x48", "wide", r"line 1: .*not a sensor size"),
        ("    id: 7", "    id: 7\n    id: 8", r"line 12: .* stands here and in line 11"),
        ("  files:", " files:", r"line \d+: not YAML"),
        ("[mocap.csv]", "", "names no files of motion capture"),
        ("  body: Rig", "  body: [1, 2]", r"line 6: `camera\.body` should be a word"),
        ("camera:", "camera: 3\ncamra:", r"is no known key"),
    ],
)
def test_a_mistake_is_named_with_its_line(folder, old, new, words):
    assert old in GOOD
    (folder / "capture.yaml").write_text(GOOD.replace(old, new, 1))
    with pytest.raises(BadFile, match=words):
        open_capture(folder)


def test_what_is_missing_is_named(folder):
    (folder / "car.off").unlink()
    with pytest.raises(NotFound, match=r"line 13: there is no .*car\.off"):
        open_capture(folder)
    (folder / "car.off").write_text(CAR)
    (folder / "capture.yaml").write_text(GOOD.replace("Object_1", "Object_9"))
    with pytest.raises(NotFound, match="no body 'Object_9'"):
        open_capture(folder).tracks()
    with pytest.raises(NotFound, match=r"capture\.yaml"):
        open_capture(folder / "nowhere")


def test_aliases_cannot_grow_without_end(tmp_path):
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]" for k in range(1, 9)]
    (tmp_path / "capture.yaml").write_text("\n".join(lines))
    with pytest.raises(BadFile, match="more than 10,000 entries"):
        load_entries(tmp_path / "capture.yaml")


def test_a_body_in_two_files_is_refused_and_not_chosen_in_silence(folder):
    (folder / "again.csv").write_text((folder / "mocap.csv").read_text())
    (folder / "capture.yaml").write_text(GOOD.replace("[mocap.csv]", "[mocap.csv, again.csv]"))
    with pytest.raises(BadFile, match=r"again\.csv: body 'Object_1' is in a file of this capture before it"):
        open_capture(folder).tracks()
