"""Poses and markers as bags, TUM and CSV hold them, against what was written by other roads."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from evimo.captures import mocap
from evimo.captures.mocap import load_markers, load_tracks
from evimo.errors import BadFile, EvimoWarning, NotFound


def write_csv(path, poses):
    lines = ["t_us,body,x,y,z,qx,qy,qz,qw"]
    for body, (times_us, position, quaternion, tracked) in poses.items():
        for k, t_us in enumerate(times_us.tolist()):
            numbers = [*position[k], *quaternion[k]] if tracked[k] else [""] * 7
            lines.append(",".join(map(str, [t_us, body, *numbers])))
    path.write_text("\n".join(lines))
    return path


def write_tum(path, pose):
    times_us, position, quaternion, tracked = pose
    rows = (
        f"{t_us / 1e6:.6f} " + " ".join(f"{value:.12f}" for value in [*place, *(turn * seen)])
        for t_us, place, turn, seen in zip(times_us.tolist(), position, quaternion, tracked, strict=True)
    )
    path.write_text("# timestamp tx ty tz qx qy qz qw\n" + "\n".join(rows))
    return path


def check(track, pose):
    times_us, position, quaternion, tracked = pose
    np.testing.assert_array_equal(track.times_us, times_us)
    np.testing.assert_array_equal(track.tracked, tracked)
    matrices = track.world_from_body[tracked]
    np.testing.assert_allclose(matrices[:, :3, 3], position[tracked], atol=1e-9)
    axis = np.array([0.3, -0.5, 0.8])
    x, y, z, w = quaternion[tracked].T
    vector = np.stack((x, y, z), axis=1)  # q v q* written out
    turned = axis + 2 * np.cross(vector, np.cross(vector, axis) + w[:, None] * axis)
    np.testing.assert_allclose(matrices[:, :3, :3] @ axis, turned, atol=1e-9)


def test_every_format_gives_the_poses_that_were_written(tmp_path, poses, vicon_bag):
    for path in (vicon_bag(tmp_path / "all.bag", poses), write_csv(tmp_path / "all.csv", poses)):
        tracks = load_tracks(path)
        assert sorted(tracks) == sorted(poses)
        for body, track in tracks.items():
            assert track.body == body
            check(track, poses[body])
    track = load_tracks(write_tum(tmp_path / "Rig.txt", poses["Rig"]))["Rig"]
    check(track, poses["Rig"])


def test_rows_out_of_order_and_twice_are_sorted_and_taken_once(tmp_path):
    rows = ["0.02 3 0 0 0 0 0 1", "0.01 2 0 0 0 0 0 1", "0.02 9 0 0 0 0 0 1", "0.0 1 0 0 0 0 0 1"]
    (tmp_path / "rig.txt").write_text("\n".join(rows))
    track = load_tracks(tmp_path / "rig.txt")["rig"]
    assert track.times_us.tolist() == [0, 10_000, 20_000]
    assert track.position[:, 0].tolist() == [1, 2, 3]


def restarted(kept, again):
    """Times of a clock that starts again after so many samples of 5 ms, and where a body is: it goes on and on."""
    times_us = np.append(5000 * np.arange(kept), 5000 * np.arange(again) + 2000)
    return times_us, np.arange(kept + again) * 0.001


@pytest.mark.parametrize("name", ["rig.txt", "rig.csv"])
def test_where_the_clock_of_motion_capture_starts_again_a_track_ends(tmp_path, name):
    """As recordings of events do: the two parts, sorted into each other, would be of a body in two places at once."""
    times_us, x = restarted(500, 300)
    gap, head = (" ", "") if name.endswith("txt") else (",", "t,x,y,z,qx,qy,qz,qw\n")
    rows = [gap.join(map(str, (t * 1e-6, place, 0, 0, 0, 0, 0, 1))) for t, place in zip(times_us, x, strict=True)]
    (tmp_path / name).write_text(head + "\n".join(rows))
    with pytest.warns(EvimoWarning, match=r"rig.*, body 'rig': the clock of .* starts again after 2495000 µs: the 300"):
        track = load_tracks(tmp_path / name)["rig"]
    np.testing.assert_array_equal(track.times_us, times_us[:500])
    np.testing.assert_allclose(track.position[:, 0], x[:500], atol=1e-9)
    (tmp_path / name).write_text(head + "\n".join(rows[200:]))
    assert len(load_tracks(tmp_path / name)["rig"]) == 300
    (tmp_path / name).write_text(head + "\n".join(rows[210:]))
    with pytest.raises(BadFile, match=r"300 of 590 samples\n  try: split the file where it does"):
        load_tracks(tmp_path / name)
    (tmp_path / name).write_text(head + "\n".join(rows[250:500] + rows[:250]))  # in another order, and no restart
    np.testing.assert_allclose(load_tracks(tmp_path / name)["rig"].position[:, 0], x[:500], atol=1e-9)


def test_markers_end_where_their_clock_starts_again_and_may_lie_one_after_another(tmp_path):
    times_us, x = restarted(500, 300)
    line = lambda name, k: f"{times_us[k]},Rig,{name},{x[k]},0,{'ab'.index(name)}"  # noqa: E731
    head, path = "t_us,body,marker,x,y,z\n", tmp_path / "markers.csv"
    path.write_text(head + "\n".join(line(name, k) for name in "ab" for k in range(500)))
    one = load_markers(path)["Rig"]
    assert one.visible.all() and len(one) == 500
    path.write_text(head + "\n".join(line(name, k) for k in range(800) for name in "ab"))
    with pytest.warns(
        EvimoWarning, match=r"markers.csv, markers of body 'Rig'.*starts again after 2495000 µs: the 600"
    ):
        two = load_markers(path)["Rig"]
    seen = two.visible.all(axis=1)
    np.testing.assert_array_equal(two.times_us[seen], one.times_us)
    np.testing.assert_array_equal(two.position[seen], one.position)
    assert not two.visible[~seen].any()


def test_markers_of_bags_and_of_csv_are_the_same(tmp_path, poses, vicon_bag):
    rng = np.random.default_rng(1)
    times_us = poses["Rig"][0]
    markers = {name: (rng.normal(size=(40, 3)), rng.random(40) > 0.3) for name in ("Rig1", "Rig2", "Rig10")}
    lines = ["t_us,body,marker,x,y,z"]
    for k, t_us in enumerate(times_us.tolist()):
        for name, (place, visible) in markers.items():
            lines.append(",".join(map(str, [t_us, "Rig", name, *(place[k] if visible[k] else ["", "", ""])])))
    (tmp_path / "markers.csv").write_text("\n".join(lines))
    bag = vicon_bag(tmp_path / "all.bag", poses, {"Rig": markers})
    for path in (bag, tmp_path / "markers.csv"):
        tracks = load_markers(path)
        assert list(tracks) == ["Rig"]
        assert tracks["Rig"].names == ("Rig1", "Rig2", "Rig10")
        np.testing.assert_array_equal(tracks["Rig"].times_us, times_us)
        for k, (place, visible) in enumerate(markers.values()):
            np.testing.assert_array_equal(tracks["Rig"].visible[:, k], visible)
            np.testing.assert_allclose(tracks["Rig"].position[visible, k], place[visible], atol=1e-9)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.txt", "0 1 2 3 0 0 0 1\n1 1 2 x 0 0 0 1\n", "a.txt, line 2"),
        ("a.txt", "0 1 2 3 0 0 0 1\n\n1 1 2 3\n", "a.txt, line 3"),
        ("a.txt", "nan 1 2 3 0 0 0 1\n", "a.txt, line 1: not a time"),
        ("a.csv", "t,x,y,z,qx,qy,qz\n", "no column 'qw'"),
        ("a.csv", "x,y,z,qx,qy,qz,qw\n", "no column of times"),
        ("a.csv", "t,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n0.1,0,0,oh,0,0,0,1\n", "a.csv, line 3"),
        ("a.txt", "", "holds no poses"),
    ],
)
def test_a_bad_line_is_named(tmp_path, name, text, words):
    (tmp_path / name).write_text(text)
    with pytest.raises(BadFile, match=words):
        load_tracks(tmp_path / name)


def test_a_damaged_message_and_a_missing_file_are_said(tmp_path, poses, vicon_bag):
    from rosbags.rosbag1 import Writer

    with Writer(tmp_path / "cut.bag") as writer:
        topic = writer.add_connection("/vicon/Rig", "vicon/msg/Subject", msgdef="Header header", md5sum="0" * 32)
        writer.write(topic, 10**9, b"\0" * 20)
    with pytest.raises(BadFile, match="/vicon/Rig is damaged"):
        load_tracks(tmp_path / "cut.bag")
    with pytest.raises(NotFound, match=r"none\.bag"):
        load_tracks(tmp_path / "none.bag")


def test_a_track_knows_another_clock(tmp_path, poses):
    track = load_tracks(write_csv(tmp_path / "all.csv", poses))["Rig"]
    assert (track.shifted(-1250).times_us - track.times_us == -1250).all()
    assert Rotation.from_matrix(track.picked(np.array([3, 5])).world_from_body[:, :3, :3]).magnitude().shape == (2,)


def test_topics_that_end_alike_are_bodies_of_their_own(tmp_path, poses, vicon_bag):
    """As /vicon/rig/pose and /vicon/wand/pose, of which one would hide the other."""
    alike = {"rig/pose": poses["Rig"], "wand/pose": poses["Object_1"], "hand": poses["Rig"]}
    tracks = load_tracks(vicon_bag(tmp_path / "all.bag", alike))
    assert set(tracks) == {"vicon/rig/pose", "vicon/wand/pose", "hand"}
    check(tracks["vicon/rig/pose"], poses["Rig"])
    check(tracks["vicon/wand/pose"], poses["Object_1"])


def test_a_long_word_or_cell_is_no_matter_of_memory(tmp_path):
    rows = [f"{k},{'b' * (100_000 if k == 7 else 1)},0,0,0,0,0,0,1" for k in range(20_000)]
    (tmp_path / "a.csv").write_text("t_us,body,x,y,z,qx,qy,qz,qw\n" + "\n".join(rows))
    tracks = load_tracks(tmp_path / "a.csv")  # as an array of words, 8 GB
    assert sorted(len(track) for track in tracks.values()) == [1, 19_999]
    (tmp_path / "b.csv").write_text("t_us,x,y,z,qx,qy,qz,qw\n1,2,3,0,0,0,0," + "1" * 200_000)
    with pytest.raises(BadFile, match=r"b\.csv, line 2: field larger than"):
        load_tracks(tmp_path / "b.csv")


def test_markers_of_which_each_sighting_has_a_name_are_refused(tmp_path):
    rows = [f"{k},a,{k if k < 15_000 else 0},1,2,3" for k in range(20_000)]
    (tmp_path / "a.csv").write_text("t_us,body,marker,x,y,z\n" + "\n".join(rows))
    with pytest.raises(BadFile, match="have 15,000 names, most of them at few of 20,000 instants"):
        load_markers(tmp_path / "a.csv")


def test_a_bag_may_tell_of_more_messages_than_it_has(tmp_path, poses, vicon_bag, monkeypatch):
    path = vicon_bag(tmp_path / "all.bag", poses)
    told = mocap.body_topics
    monkeypatch.setattr(mocap, "body_topics", lambda bag: [topic._replace(messages=1 << 40) for topic in told(bag)])
    check(load_tracks(path)["Rig"], poses["Rig"])
