"""Bags with several cameras: which one is read, and whose calibration, camera info and gyroscope go with it."""

import numpy as np
import pytest
from rosbags import rosbag1

from evimo.errors import EvimoWarning, NotFound
from evimo.formats import open_events
from evimo.geometry.calibration import load_camera

KIND, PART, EPOCH_US = "dvs_msgs/msg/EventArray", 100, 1_600_000_000_000_000
TOPICS = "/davis/left/events", "/davis/right/events"
CHAIN = "".join(
    f"""\
cam{number}:
  camera_model: pinhole
  distortion_coeffs: [0, 0, 0, 0]
  distortion_model: radtan
  intrinsics: [{focal}, {focal}, 30, 20]
  resolution: [64, 48]
  rostopic: /davis/{side}/image_raw
"""
    for number, side, focal in ((0, "left", 100), (1, "right", 200))
)


@pytest.fixture
def sides(events):
    """Events of the left and of the right camera."""
    left = type(events)(events.x, events.y, EPOCH_US + events.t, events.p)
    return left, type(events)(63 - events.x, events.y, left.t + 7, events.p)


@pytest.fixture(params=["ROS 1", "db3", "mcap"])
def write(request, tmp_path, ros2):
    """Writes topics as a bag of one of three kinds; messages of ROS 1 by the library's own conversion."""

    def write(topics):
        if request.param != "ROS 1":
            return ros2.write_bag(tmp_path / "bag", topics, request.param)
        path = tmp_path / "bag.bag"
        with rosbag1.Writer(path) as writer:
            for name, (kind, messages) in topics.items():
                topic = writer.add_connection(name, kind, msgdef="Header header", md5sum="0" * 32)
                for time_ns, payload in messages:
                    writer.write(topic, time_ns, ros2.TYPES.cdr_to_ros1(payload, kind))
        return path

    return write


@pytest.fixture
def stereo(write, sides, ros2):
    def topics(order=(0, 1), counts=(1000, 1000)):
        return {TOPICS[side]: (KIND, ros2.messages_of(sides[side].part(0, counts[side]), ros2.array)) for side in order}

    return lambda more=None, **how: write(topics(**how) | (more or {}))


def test_topic_chooses_the_camera(stereo, sides, rows):
    path = stereo(order=(1, 0))
    for topic, side in zip(TOPICS, sides, strict=True):
        opened = open_events(path, topic=topic)
        assert opened.topic == topic and rows(opened) == rows([side])
    assert rows(open_events(path, topic="davis/right/events")) == rows([sides[1]])


def test_without_a_topic_the_first_by_name_of_the_large_ones_is_read_and_said(stereo, sides, rows):
    with pytest.warns(EvimoWarning, match=f"{TOPICS[0]} is read, not {TOPICS[1]}; --topic NAME chooses"):
        opened = open_events(stereo(order=(1, 0), counts=(900, 1000)))
    assert opened.topic == TOPICS[0] and rows(opened) == rows([sides[0].part(0, 900)])
    listed = opened.contents["event topics"]
    assert listed == "/davis/left/events (9), /davis/right/events (10)"


def test_a_topic_with_hardly_any_events_is_not_the_first(stereo, sides):
    with pytest.warns(EvimoWarning, match=f"{TOPICS[1]} is read"):
        assert open_events(stereo(counts=(400, 1000))).topic == TOPICS[1]


def test_a_topic_that_is_not_there_is_an_error_that_lists_those_that_are(stereo):
    with pytest.raises(
        NotFound, match=r"(?s)no events on the topic /left.*/davis/left/events \(10 messages\), /davis/r"
    ):
        open_events(stereo(), topic="/left")


@pytest.mark.filterwarnings("ignore::evimo.errors.EvimoWarning")
def test_the_calibration_of_that_camera_is_picked(stereo, tmp_path):
    (tmp_path / "chain.yaml").write_text(CHAIN)
    path = stereo(order=(1, 0))
    for topic, focal in ((None, 100), (TOPICS[0], 100), (TOPICS[1], 200)):
        opened = open_events(path, topic=topic)
        assert load_camera(tmp_path / "chain.yaml", size=opened.sensor, topic=opened.topic).fx == focal


def test_the_camera_info_and_the_gyroscope_are_those_of_the_same_camera(stereo, ros2):
    at = EPOCH_US * 1000
    times = EPOCH_US + 1000 * np.arange(40)
    more = {
        "/davis/right/camera_info": ("sensor_msgs/msg/CameraInfo", [(at, ros2.camera_info(60.0))]),
        "/davis/left/camera_info": ("sensor_msgs/msg/CameraInfo", [(at, ros2.camera_info(50.0))]),
        "/other/camera_info": ("sensor_msgs/msg/CameraInfo", [(at, ros2.camera_info(70.0))]),
        "/davis/left/imu": ("sensor_msgs/msg/Imu", [(at, ros2.imu(t, (1, 2, 3))) for t in times]),
        "/davis/right/imu": ("sensor_msgs/msg/Imu", [(at, ros2.imu(t, (4, 5, 6))) for t in times]),
    }
    path = stereo(more)
    for topic, focal, rate in ((TOPICS[0], 50, (1, 2, 3)), (TOPICS[1], 60, (4, 5, 6))):
        opened = open_events(path, topic=topic)
        camera, gyroscope = opened.camera.camera, opened.gyroscope()
        assert (camera.fx, camera.fy, camera.cx, camera.distortion[2]) == (focal, focal + 1, 31, 0.3)
        assert np.array_equal(gyroscope.t_us, times) and np.allclose(gyroscope.rate, rate)


def test_camera_infos_of_others_are_not_taken_where_they_differ(write, sides, ros2):
    topics = {"/dvs/events": (KIND, ros2.messages_of(sides[0], ros2.array))}
    infos = {
        f"/{name}/info": ("sensor_msgs/msg/CameraInfo", [(1, ros2.camera_info(60.0 + n))])
        for n, name in enumerate("ab")
    }
    assert open_events(write(topics | infos)).camera is None


def test_one_camera_info_of_another_name_is_taken(write, sides, ros2):
    topics = {
        "/dvs/events": (KIND, ros2.messages_of(sides[0], ros2.array)),
        "/a/info": ("sensor_msgs/msg/CameraInfo", [(1, ros2.camera_info(60.0))]),
        "/b/info": ("sensor_msgs/msg/CameraInfo", [(1, ros2.camera_info(99.0, size=(10, 10)))]),
    }
    found = open_events(write(topics)).camera
    assert found.camera.fx == 60 and found.source == "/a/info in the bag"


def test_a_topic_whose_publisher_was_started_again_is_one_topic(tmp_path, sides, rows, ros2):
    """A ROS 1 bag then has two connections for it."""
    left, _ = sides
    messages = ros2.messages_of(left, ros2.array)
    with rosbag1.Writer(tmp_path / "a.bag") as writer:
        made = [
            writer.add_connection(TOPICS[0], KIND, msgdef="Header header", md5sum="0" * 32, callerid=caller)
            for caller in ("/one", "/two")
        ]
        for number, (time_ns, payload) in enumerate(messages):
            writer.write(made[number // 5], time_ns, ros2.TYPES.cdr_to_ros1(payload, KIND))
    opened = open_events(tmp_path / "a.bag")
    assert rows(opened) == rows([left]) and opened.contents == {"event topics": f"{TOPICS[0]} (10)"}
