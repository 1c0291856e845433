"""Every event of the reference recordings, against counts and digests by independent readers."""

import csv
import hashlib

import numpy as np
import pytest

from evimo.events.events import joined
from evimo.formats import open_events

DIGESTED = {
    "es-dvs": "formats/event_stream/dvs.es",
    "aedat4": "recordings/davis346_road/davis346.aedat4",
    "evt2": "formats/prophesee/evt2.raw",
    "evt3": "formats/prophesee/evt3.raw",
}
COUNTED = {
    "formats/event_stream/dvs.es": ((240, 320), 473_225),
    "recordings/eed_what_is_background/EED_what_is_background_events.es": ((180, 190), 271_264),
    "recordings/davis346_ball_person/dvSave-2021_01_15_15_43_05.aedat4": ((260, 346), 237_073),
    "recordings/davis346_road/davis346.aedat4": ((260, 346), 78_830),
    "recordings/davis240_poster/poster_translation.npz": ((180, 240), 100_000),
    "recordings/davis240_boxes_imu/IMU_translBoxes.aedat": ((180, 240), 162_771),
    "formats/aedat/aedat2_dvs128_dark_box.aedat": ((128, 128), 489_834),
    "formats/prophesee/evt2.raw": ((480, 640), 521_252),
    "formats/prophesee/evt3.raw": ((720, 1280), 1_218_618),
    "formats/prophesee/evt3_sample.raw": ((720, 1280), 219_596),
    "formats/prophesee/sample_ncars.dat": ((128, 128), 2_009),
    "formats/aedat/dvxplorer_head.aedat4": ((240, 320), 111_954),
    "formats/ros/davis346_1s_dvs_msgs.bag": ((260, 346), 35_525),
    "formats/ros/event_camera_msgs_evt3.bag": ((480, 640), 343_474),
    "formats/ros/event_camera_msgs_evt3_db3": ((480, 640), 343_474),
    "formats/ros/event_camera_msgs_mcap": ((260, 346), 571_266),
    "formats/ros/test_data_evt3_trigger": ((720, 1280), 82_469),
    "formats/ros/test_data_libcaer_rollover": ((480, 640), 334_331),
    "formats/ros/test_data_mono_cd": ((480, 640), 100),
    "formats/text/ecd_text/events.txt": ((260, 346), 35_525),
    "formats/hdf5/davis346_1s_dsec_style.h5": ((260, 346), 35_525),
    "formats/hdf5/davis346_1s_mvsec_style.h5": ((260, 346), 35_525),
    "recordings/davis346_night/events.npz": ((260, 346), 130_444),
    "recordings/davis240_pan_tilt/events.npz": ((180, 240), 132_784),
}


# ON events by the tests of the projects that recorded them.
ON = {
    "formats/ros/event_camera_msgs_evt3.bag": 125_183,
    "formats/ros/event_camera_msgs_evt3_db3": 125_183,
    "formats/ros/event_camera_msgs_mcap": 211_043,
    "formats/ros/test_data_evt3_trigger": 41_439,
    "formats/ros/test_data_mono_cd": 50,
}


def digest(column):
    return hashlib.sha3_224(column.tobytes()).hexdigest()


@pytest.mark.parametrize("name", DIGESTED)
def test_columns_have_the_expected_digests(name, shared_data):
    with shared_data("formats/expected_digests.csv").open() as table:
        expected = {
            row["field"]: row["sha3_224_of_the_column_bytes"] for row in csv.DictReader(table) if row["format"] == name
        }
    events = joined(list(open_events(shared_data(DIGESTED[name]))))
    columns = {"t": events.t.astype("<u8"), "x": events.x, "y": events.y, "on": events.p > 0}
    assert {field: digest(column) for field, column in columns.items()} == {field: expected[field] for field in columns}


def test_evt3_is_as_its_reference_decode_but_for_its_wrong_times(shared_data):
    """The reference takes each step back of the lower bits, 11 of at most 11 us, for a missing TIME HIGH of 4096 us."""
    reference = np.load(shared_data("formats/prophesee/evt3_sample.npy"))
    events = joined(list(open_events(shared_data("formats/prophesee/evt3_sample.raw"))))
    assert np.array_equal(events.x, reference["x"]) and np.array_equal(events.y, reference["y"])
    assert np.array_equal(events.p > 0, reference["p"] > 0)
    too_late = reference["t"] - events.t
    assert np.all(too_late % 4096 == 0) and too_late.max() == 11 * 4096


@pytest.mark.filterwarnings("ignore::evimo.errors.EvimoWarning")
@pytest.mark.parametrize("name", COUNTED)
def test_recordings_have_the_expected_size_and_count(name, shared_data):
    sensor, count = COUNTED[name]
    recording = open_events(shared_data(name))
    events = joined(list(recording))
    assert (recording.sensor, len(events)) == (sensor, count)
    assert (recording.start_us, recording.stop_us) == (events.t[0], events.t[-1] + 1)
    assert np.all(np.diff(events.t) >= 0) and recording.faults.dropped == 0


@pytest.mark.parametrize("name", ON)
def test_bags_have_the_published_number_of_on_events(name, shared_data):
    assert sum(int((packet.p > 0).sum()) for packet in open_events(shared_data(name))) == ON[name]


def test_the_same_events_in_two_bags_are_the_same(shared_data):
    one, other = (
        joined(list(open_events(shared_data(f"formats/ros/event_camera_msgs_evt3{end}")))) for end in (".bag", "_db3")
    )
    assert [digest(column) for column in (one.t, one.x, one.y, one.p)] == [
        digest(column) for column in (other.t, other.x, other.y, other.p)
    ]


@pytest.mark.filterwarnings("ignore::evimo.errors.EvimoWarning")
@pytest.mark.parametrize("name", COUNTED)
def test_seeking_finds_what_reading_everything_finds(name, shared_data):
    recording = open_events(shared_data(name))
    events = joined(list(recording))
    span = recording.stop_us - recording.start_us
    for start, stop in ((0.1, 0.11), (0.5, 0.7), (0.98, 2.0)):
        window = recording.start_us + int(start * span), recording.start_us + int(stop * span)
        assert joined(list(recording.packets(*window))).t.tolist() == events.between(*window).t.tolist()
