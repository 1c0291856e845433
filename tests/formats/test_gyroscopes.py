"""Gyroscopes of all formats but AEDAT 2, against what other programs wrote and read."""

import json

import dv_processing
import numpy as np
import pytest
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

from evimo.errors import BadFile, EvimoWarning
from evimo.formats import open_events
from evimo.formats.aedat4_packets import head, packet_table
from evimo.formats.bag_topics import EventTopic
from evimo.recordings.writer import RecordingWriter
from evimo.simulate.imu import ImuSettings
from evimo.simulate.plan import RecordingPlan
from evimo.simulate.recording import simulate_recording

TYPES = get_typestore(Stores.ROS1_NOETIC)
ROAD = "recordings/davis346_road/davis346.aedat4"
T = 1_600_000_000_000_000 + 1000 * np.arange(60)
RATE = np.random.default_rng(0).normal(size=(60, 3)) * 90
RATE[7] = 0.0  # a FlatBuffer leaves zeros out


@pytest.mark.parametrize("name", [ROAD, "recordings/davis346_ball_person/dvSave-2021_01_15_15_43_05.aedat4"])
def test_aedat4_says_what_inivations_own_library_says(shared_data, name):
    path = shared_data(name)
    recording, samples = dv_processing.io.MonoCameraRecording(str(path)), []
    while batch := recording.getNextImuBatch():
        samples += [(each.timestamp, each.gyroscopeX, each.gyroscopeY, each.gyroscopeZ) for each in batch]
    found, expected = open_events(path).gyroscope(), np.array(samples)
    assert np.array_equal(found.t_us, expected[:, 0]) and not found.in_camera_axes
    assert np.allclose(np.degrees(found.rate), expected[:, 1:], atol=1e-6)


@pytest.fixture
def aedat4(tmp_path, events):
    writing = dv_processing.io.MonoCameraWriter
    config = writing.Config("camera", dv_processing.CompressionType.LZ4)
    config.addEventStream((64, 48))
    config.addImuStream()
    path = tmp_path / "a.aedat4"
    writer = writing(str(path), config)
    store = dv_processing.EventStore()
    for x, y, t, p in zip(events.x.tolist(), events.y.tolist(), events.t.tolist(), events.p.tolist(), strict=True):
        store.push_back(t, x, y, p > 0)
    writer.writeEvents(store)
    for t, (x, y, z) in zip(T.tolist(), RATE.tolist(), strict=True):
        writer.writeImu(dv_processing.IMU(t, 20.0, 0.0, -1.0, 0.0, x, y, z, 0.0, 0.0, 0.0))
    del writer
    return path


def test_aedat4_samples_are_read_back_with_zeros(aedat4):
    found = open_events(aedat4).gyroscope()
    assert np.array_equal(found.t_us, T) and np.allclose(np.degrees(found.rate), RATE, atol=1e-4)
    assert found.source == "IMU of camera"


def test_a_damaged_packet_of_samples_is_left_out_and_counted(aedat4):
    whole, top = bytearray(aedat4.read_bytes()), head(aedat4)
    stream = next(name for name, stream in top.streams.items() if stream.kind == "IMUS")
    table = packet_table(aedat4, top).of(stream)
    assert len(table.offset) > 1
    at = table.offset[0] + 8
    whole[at : at + 20] = b"\x55" * 20
    aedat4.write_bytes(whole)
    with pytest.warns(EvimoWarning, match="1 packets of IMU samples are damaged"):
        found = open_events(aedat4).gyroscope()
    assert len(found) == len(T) - table.count[0]


def test_a_cut_aedat4_still_gives_its_samples(aedat4):
    whole, top = aedat4.read_bytes(), head(aedat4)
    aedat4.write_bytes(whole[: top.table_at])
    with pytest.warns(EvimoWarning, match="cut short"):
        opened = open_events(aedat4)
    assert np.array_equal(opened.gyroscope().t_us, T)


def test_a_bag_made_of_a_recording_says_what_the_recording_says(shared_data):
    found = open_events(shared_data("formats/ros/davis346_1s_dvs_msgs.bag")).gyroscope()
    original = open_events(shared_data(ROAD)).gyroscope()
    assert len(found) == 1001 and not found.in_camera_axes
    assert np.array_equal(found.t_us, original.t_us[: len(found)])
    assert np.allclose(found.rate, original.rate[: len(found)], atol=1e-5)


def imu_message(t_us, rate, unknown=0.0):
    kinds = TYPES.types
    vector, turn = kinds["geometry_msgs/msg/Vector3"], kinds["geometry_msgs/msg/Quaternion"]
    stamp = kinds["builtin_interfaces/msg/Time"](sec=int(t_us // 10**6), nanosec=int(t_us % 10**6) * 1000)
    message = kinds["sensor_msgs/msg/Imu"](
        header=kinds["std_msgs/msg/Header"](seq=0, stamp=stamp, frame_id="a frame"),
        orientation=turn(0.1, 0.2, 0.3, 0.9),
        orientation_covariance=np.full(9, 0.5),
        angular_velocity=vector(*rate),
        angular_velocity_covariance=np.full(9, unknown),
        linear_acceleration=vector(1.0, 2.0, 3.0),
        linear_acceleration_covariance=np.zeros(9),
    )
    return TYPES.serialize_ros1(message, "sensor_msgs/msg/Imu")


def write_bag(path, events_message, imus, cut=None):
    """A bag of one event message and IMU messages by topic."""
    with Writer(path) as writer:
        kind, payload = events_message
        topic = writer.add_connection("/cam/events", kind, msgdef="Header header", md5sum="0" * 32)
        writer.write(topic, int(T[0]) * 1000, payload)
        for name, messages in imus.items():
            topic = writer.add_connection(name, "sensor_msgs/msg/Imu", typestore=TYPES)
            for payload in messages:
                writer.write(topic, int(T[0]) * 1000, payload[:cut])
    return path


def array_of_one_event():
    header = np.array([0, T[0] // 10**6, 0, 0], "<u4").tobytes()
    event = np.array([1, 1], "<u2").tobytes() + np.array([T[0] // 10**6, 0], "<u4").tobytes() + b"\1"
    return "dvs_msgs/msg/EventArray", header + np.array([48, 64, 1], "<u4").tobytes() + event


def test_of_several_topics_that_beside_the_events_is_read(tmp_path):
    messages = [imu_message(t, rate) for t, rate in zip(T, RATE, strict=True)]
    silent = [imu_message(T[3] + 1, (9, 9, 9), unknown=-1.0)]
    imus = {"/arm/imu": messages + messages, "/cam/imu": messages + silent}
    opened = open_events(write_bag(tmp_path / "a.bag", array_of_one_event(), imus))
    found = opened.gyroscope()
    assert found.source == "/cam/imu in the bag"
    assert np.array_equal(found.t_us, T) and np.allclose(found.rate, RATE)
    far = open_events(write_bag(tmp_path / "b.bag", array_of_one_event(), {"/arm/imu": messages}))
    assert np.array_equal(far.gyroscope().t_us, T)


def test_a_bag_whose_samples_are_cut_is_refused_and_one_without_has_none(tmp_path):
    opened = open_events(
        write_bag(tmp_path / "a.bag", array_of_one_event(), {"/cam/imu": [imu_message(1, RATE[0])]}, 90)
    )
    with pytest.raises(BadFile, match="a message of /cam/imu is damaged"):
        opened.gyroscope()
    assert open_events(write_bag(tmp_path / "b.bag", array_of_one_event(), {})).gyroscope() is None


def test_stamps_follow_events_that_are_in_the_sensors_own_clock():
    """In evt3 events begin near zero while stamps are absolute."""
    topic = EventTopic(bag=None, topic=None, clocks_us=(1_600_000_000_000_000, 250_000))
    assert topic.of_stamp(1_600_000_000_100_000_000) == 350_000
    shared = EventTopic(bag=None, topic=None, clocks_us=(1_600_000_000_000_000, 1_599_999_999_990_000))
    assert shared.of_stamp(1_600_000_000_100_000_000) == 1_600_000_000_100_000


def test_a_simulated_camera_turns_by_what_its_gyroscope_says(tmp_path):
    """In camera axes: the mean over 25 ms is the change of the exact pose in them, but for bias and noise."""
    film = simulate_recording(RecordingPlan(seed=7, set_number=3, seconds=0.2, size=(33, 44)))
    with RecordingWriter(tmp_path / "film", film.camera, poses=film.poses, imu=film.imu(ImuSettings())) as writer:
        for piece in film:
            writer.write(piece.events, piece.truth)
    with np.load(tmp_path / "film" / "dataset_sim.npz", allow_pickle=False) as sim:
        times_us, turn = sim["trajectory_us"][::5], sim["trajectory_world_from_cam"][::5, :3, :3]
    found = open_events(tmp_path / "film").gyroscope()
    rate, valid = found.mean_rates(times_us[:-1], times_us[1:])
    exact = Rotation.from_matrix(turn[:-1].swapaxes(1, 2) @ turn[1:]).as_rotvec() / 0.025
    assert found.in_camera_axes and valid.all() and len(valid) >= 8
    error = rate - exact
    assert np.abs(exact).max() > 0.05 and np.abs(error).max() < 0.05
    assert np.abs(error - np.median(error, axis=0)).max() < 5e-3


@pytest.fixture
def folder(tmp_path, events):
    np.save(tmp_path / "dataset_events_t.npy", events.t / 1e6)
    np.save(tmp_path / "dataset_events_xy.npy", np.stack([events.x, events.y], axis=1))
    np.save(tmp_path / "dataset_events_p.npy", (events.p > 0).astype(np.uint8))
    meta = {"fx": 40, "fy": 41, "cx": 30, "cy": 20, "res_x": 64, "res_y": 48}
    (tmp_path / "dataset_info.json").write_text(json.dumps({"meta": meta}))
    return tmp_path


def test_a_folder_of_the_simulator(folder):
    assert open_events(folder).gyroscope() is None
    np.savez(folder / "dataset_imu.npz", t_us=T, gyro=RATE.astype(np.float32))
    found = open_events(folder).gyroscope()
    assert found.in_camera_axes and np.array_equal(found.t_us, T) and np.allclose(found.rate, RATE, atol=1e-4)
    np.savez(folder / "dataset_imu.npz", t_us=T[:-1], gyro=RATE)
    with pytest.raises(BadFile, match="do not fit together"):
        open_events(folder).gyroscope()


def test_a_folder_of_evimo2_whose_pickle_was_written_as_json(folder):
    def stored(rates):
        words = ("x", "y", "z")
        return [
            {"ts": 0.005 * k, "angular_velocity": dict(zip(words, rate, strict=True))} for k, rate in enumerate(rates)
        ]

    path = folder / "dataset_info.json"
    info = json.loads(path.read_text())
    path.write_text(
        json.dumps(info | {"imu": {"/b/imu": stored((RATE + 1).tolist()), "/a/imu": stored(RATE.tolist())}})
    )
    found = open_events(folder).gyroscope()
    assert not found.in_camera_axes and found.source == "/a/imu in dataset_info.json"
    assert np.array_equal(found.t_us, 5000 * np.arange(60)) and np.allclose(found.rate, RATE)
    path.write_text(json.dumps(info | {"imu": {"/a/imu": [{"ts": 1.0}]}}))
    with pytest.raises(BadFile, match="not as EVIMO2 has it"):
        open_events(folder).gyroscope()


def test_text_has_none(tmp_path):
    (tmp_path / "a.txt").write_text("0,5,6,1\n4,7,8,0\n")
    assert open_events(tmp_path / "a.txt", sensor=(48, 64)).gyroscope() is None
