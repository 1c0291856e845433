"""ROS 2 bags, against the writer and the serialisation of the rosbags library."""

import shutil
import sqlite3

import pytest

from evimo.errors import BadFile, EvimoWarning
from evimo.formats import open_events

EPOCH_US = 1_600_000_000_000_000
ARRAYS = ["dvs_msgs/msg/EventArray", "prophesee_event_msgs/msg/EventArray"]
PACKETS = ["event_camera_msgs/msg/EventPacket", "event_array_msgs/msg/EventArray"]
STORED = [("db3", None), ("db3", "message"), ("mcap", None), ("mcap", "lz4"), ("mcap", "zstd"), ("mcap", "message")]


@pytest.fixture
def absolute(events):
    """The same events over 10 s, in the clock of a robot."""
    return type(events)(events.x, events.y, EPOCH_US + 50 * events.t, events.p)


@pytest.fixture
def bag(tmp_path, absolute, ros2):
    def write(storage="mcap", compression=None, kind=ARRAYS[0], make=None, name="bag", events=absolute, **how):
        make = make or (ros2.array if kind in ARRAYS else ros2.packet)
        messages = ros2.messages_of(events, lambda part: make(part, kind=kind))
        return ros2.write_bag(tmp_path / name, {"/cam/events": (kind, messages)}, storage, compression, **how)

    return write


@pytest.mark.parametrize("kind", ARRAYS + PACKETS)
@pytest.mark.parametrize("storage, compression", STORED)
def test_what_was_written_is_read(bag, absolute, rows, kind, storage, compression):
    opened = open_events(bag(storage, compression, kind))
    assert (opened.sensor, opened.start_us, opened.stop_us) == ((48, 64), absolute.t[0], absolute.t[-1] + 1)
    assert (opened.topic, opened.contents) == ("/cam/events", {"event topics": "/cam/events (10)"})
    assert opened.format == f"ROS 2 bag, {storage} ({kind.replace('/msg', '')})"
    assert rows(opened) == rows([absolute])
    start = EPOCH_US + 6_000_000
    assert rows(opened.packets(start, start + 1_000_000)) == rows([absolute.between(start, start + 1_000_000)])


@pytest.mark.parametrize("storage", ["db3", "mcap"])
def test_one_file_or_the_metadata_stands_for_the_folder(bag, absolute, rows, ros2, storage):
    folder = bag(storage)
    assert rows(open_events(ros2.storage_file(folder))) == rows([absolute])
    assert rows(open_events(folder / "metadata.yaml")) == rows([absolute])


@pytest.mark.parametrize("storage", ["db3", "mcap"])
@pytest.mark.parametrize("metadata", [None, "", "storage_identifier: ''\n", "a: [", "rosbag2_bagfile_information: 3\n"])
def test_the_metadata_is_not_needed(bag, absolute, rows, storage, metadata):
    """A recorder that was killed writes none; some programs leave the storage's name out."""
    folder = bag(storage)
    (folder / "metadata.yaml").unlink()
    if metadata is not None:
        (folder / "metadata.yaml").write_text(metadata)
    assert rows(open_events(folder)) == rows([absolute])


@pytest.mark.parametrize("length", range(9))
@pytest.mark.parametrize("kind", [ARRAYS[0], PACKETS[0]])
def test_fields_are_found_behind_a_frame_of_any_length(bag, absolute, rows, ros2, kind, length):
    make = ros2.array if kind in ARRAYS else ros2.packet
    folder = bag(kind=kind, make=lambda part, kind: make(part, kind=kind, frame="f" * length))
    assert rows(open_events(folder)) == rows([absolute])


TABLES_OF_OLD = [
    ["DROP TABLE message_definitions"],
    ["DROP TABLE message_definitions", "DROP TABLE schema", "DROP TABLE metadata"],
    ["DROP TABLE schema", "ALTER TABLE topics DROP COLUMN type_description_hash"],
    ["DROP TABLE schema", "ALTER TABLE topics DROP COLUMN offered_qos_profiles"],
    ["DROP INDEX timestamp_idx"],
]


@pytest.mark.parametrize("changes", TABLES_OF_OLD)
def test_db3_of_any_version_is_read(bag, absolute, rows, ros2, changes):
    folder = bag("db3")
    with sqlite3.connect(ros2.storage_file(folder)) as database:
        for change in changes:
            database.execute(change)
    database.close()
    assert rows(open_events(folder)) == rows([absolute])


def test_messages_are_read_by_time_wherever_they_lie(tmp_path, absolute, rows, ros2):
    messages = ros2.messages_of(absolute, ros2.array)
    folder = ros2.write_bag(tmp_path / "bag", {"/cam/events": (ARRAYS[0], messages)}, "db3")
    with sqlite3.connect(ros2.storage_file(folder)) as database:
        database.execute("UPDATE messages SET id = 100 - id")
    database.close()
    assert rows(open_events(folder)) == rows([absolute])


@pytest.mark.parametrize("storage", ["db3", "mcap"])
def test_a_bag_in_several_files_is_one_recording(bag, tmp_path, absolute, rows, ros2, storage):
    whole = tmp_path / "whole"
    whole.mkdir()
    for number, (start, stop) in enumerate(((600, 1000), (0, 300), (300, 600))):
        folder = bag(storage, events=absolute.part(start, stop), name=f"part{number}")
        shutil.copy(ros2.storage_file(folder), whole / f"a_{number}.{storage}")
    opened = open_events(whole)
    assert rows(opened) == rows([absolute])
    assert opened.contents == {"event topics": "/cam/events (10)"}
    start = int(absolute.t[500])
    assert rows(opened.packets(start, start + 2_000_000)) == rows([absolute.between(start, start + 2_000_000)])
    listed = "".join(f"  - a_{number}.{storage}\n" for number in range(3))
    (whole / "metadata.yaml").write_text(f"rosbag2_bagfile_information:\n  relative_file_paths:\n{listed}")
    (whole / f"a_1.{storage}").unlink()
    with pytest.warns(EvimoWarning, match=rf"lacks a_1\.{storage}"):
        assert rows(open_events(whole)) == rows([absolute.part(300, 1000)])


@pytest.mark.parametrize("compression", [None, "zstd", "lz4"])
def test_an_mcap_that_was_cut_short_is_read_up_to_its_last_whole_chunk(bag, absolute, rows, ros2, compression):
    path = ros2.storage_file(bag("mcap", compression, chunk=2))
    whole = path.read_bytes()
    for share in (0.5, 0.8, 0.97):
        path.write_bytes(whole[: int(share * len(whole))])
        with pytest.warns(EvimoWarning, match="has lost its index"):
            opened = open_events(path)
        seen = rows(opened)
        assert len(seen) >= 200 and len(seen) % 200 == 0 and seen == rows([absolute])[: len(seen)]
        start = int(absolute.t[150])
        assert rows(opened.packets(start, start + 10)) == rows([absolute.between(start, start + 10)])


def test_a_db3_that_was_cut_short_is_read_up_to_the_cut(bag, absolute, rows, ros2):
    path = ros2.storage_file(bag("db3"))
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) * 3 // 4])
    with pytest.warns(EvimoWarning, match="has lost its index"):
        opened = open_events(path)
    seen = rows(opened)
    assert 300 <= len(seen) < 1000 and seen == rows([absolute])[: len(seen)]


@pytest.mark.parametrize("storage", ["db3", "mcap"])
@pytest.mark.parametrize("size", [17, 100, 700])
def test_a_bag_of_which_nearly_nothing_is_left_is_refused(bag, ros2, storage, size):
    path = ros2.storage_file(bag(storage))
    path.write_bytes(path.read_bytes()[:size])
    with pytest.raises(BadFile, match=r"(?s)bag\.(db3|mcap).*\n  try: "):
        open_events(path)


def test_messages_that_wait_in_the_journal_are_read(bag, absolute, rows, ros2, tmp_path):
    """A recorder that was killed leaves them there."""
    path = ros2.storage_file(bag("db3"))
    database = sqlite3.connect(path)
    database.execute("PRAGMA journal_mode=WAL")
    database.execute("PRAGMA wal_autocheckpoint=0")
    messages = database.execute("SELECT * FROM messages ORDER BY id").fetchall()
    database.execute("DELETE FROM messages WHERE id > 4")
    database.commit()
    database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    database.executemany("INSERT INTO messages VALUES (?, ?, ?, ?)", messages[4:])
    database.commit()
    killed = tmp_path / "killed"
    killed.mkdir()
    for name in (path.name, f"{path.name}-wal"):
        shutil.copy(path.with_name(name), killed / name)
    database.close()
    assert (killed / f"{path.name}-wal").stat().st_size > 0
    assert rows(open_events(killed)) == rows([absolute])


def test_a_bag_that_is_compressed_file_by_file_says_how_to_unpack_it(bag, absolute, rows, ros2):
    folder = bag("db3", "file")
    with pytest.raises(BadFile, match=r"compressed file by file .*\n  try: unpack it first: unzstd"):
        open_events(folder)
    (packed,) = folder.glob("*.zstd")
    packed.with_suffix("").write_bytes(ros2.unpacked(packed.read_bytes()))
    assert rows(open_events(folder)) == rows([absolute])


@pytest.mark.parametrize("storage", ["db3", "mcap"])
def test_seeking_finds_the_round_of_a_clock_that_wraps_every_17_seconds(bag, events, rows, ros2, storage):
    long = type(events)(events.x, events.y, 3_000_000 + 500 * events.t, events.p)  # 100 s, six rounds
    opened = open_events(
        bag(storage, kind=PACKETS[0], make=lambda part, kind: ros2.packet(part, encoding="evt3"), events=long)
    )
    assert (opened.start_us, opened.stop_us) == (long.t[0], long.t[-1] + 1)
    assert rows(opened) == rows([long])
    for start in (20_000_000, 60_000_000, 95_000_000):
        assert rows(opened.packets(start, start + 5_000_000)) == rows([long.between(start, start + 5_000_000)])


@pytest.mark.parametrize("storage", ["db3", "mcap"])
def test_reading_from_a_time_on_skips_what_was_recorded_long_before(bag, storage):
    opened = open_events(bag(storage, chunk=1 if storage == "mcap" else None))
    first = next(iter(opened.read(EPOCH_US + 9_000_000)))
    assert EPOCH_US + 5_000_000 < first.t[0] < EPOCH_US + 9_000_000


def test_packets_stay_small_however_long_the_bag(tmp_path, events, ros2):
    payload = ros2.array(events)
    messages = [(1000 * number, payload) for number in range(300)]
    folder = ros2.write_bag(tmp_path / "bag", {"/cam/events": (ARRAYS[0], messages)})
    sizes = [len(packet) for packet in open_events(folder).read(0)]
    assert sum(sizes) == 300_000 and max(sizes) * 16 < 1.1 * 2**20


BAD_MESSAGES = {
    "big-endian": lambda payload: b"\0\0" + payload[2:],
    "empty": lambda payload: b"",
    "head alone": lambda payload: payload[:20],
    "cut": lambda payload: payload[:-20],
    "text": lambda payload: payload[:12] + b"\xff\xff\xff\xff" + payload[16:],
    "broken zstd": lambda payload: b"\x28\xb5\x2f\xfd" + payload,
}
COUNT_AT = {ARRAYS[0]: 32, PACKETS[0]: 64}  # of events, of bytes, behind a frame of seven letters


@pytest.mark.parametrize("name", [*BAD_MESSAGES, "count"])
@pytest.mark.parametrize("kind", COUNT_AT)
def test_a_bag_of_damaged_messages_alone_is_an_error_that_names_the_topic(bag, ros2, kind, name):
    def worse(part, kind):
        payload = (ros2.array if kind in ARRAYS else ros2.packet)(part, kind=kind, frame="seven77")
        at = COUNT_AT[kind]
        return (
            payload[:at] + b"\xff\xff\xff\x7f" + payload[at + 4 :] if name == "count" else BAD_MESSAGES[name](payload)
        )

    with pytest.raises(BadFile, match="a message of /cam/events is damaged"):
        open_events(bag(kind=kind, make=worse))


@pytest.mark.parametrize("name", BAD_MESSAGES)
@pytest.mark.parametrize("number", [0, 4, 9])
def test_a_damaged_message_costs_itself_and_is_counted(tmp_path, absolute, rows, ros2, name, number):
    messages = ros2.messages_of(absolute, ros2.array)
    time_ns, payload = messages[number]
    messages[number] = time_ns, BAD_MESSAGES[name](payload)
    opened = open_events(ros2.write_bag(tmp_path / "bag", {"/cam/events": (ARRAYS[0], messages)}))
    with pytest.warns(EvimoWarning, match="1 messages of /cam/events are damaged and left out"):
        found = rows(opened)
    whole = rows([absolute])
    assert found == whole[: 100 * number] + whole[100 * number + 100 :]


def test_an_unknown_encoding_and_a_serialisation_of_others_are_said(bag, ros2):
    folder = bag(kind=PACKETS[0], make=lambda part, kind: ros2.packet(part, encoding="evt9"))
    with pytest.raises(BadFile, match="'evt9' are not supported"):
        open_events(folder)
    folder = bag("db3", name="other")
    with sqlite3.connect(ros2.storage_file(folder)) as database:
        database.execute("UPDATE topics SET serialization_format = 'protobuf'")
    database.close()
    with pytest.raises(BadFile, match="serialised as 'protobuf'"):
        open_events(folder)


def test_bags_without_events_and_other_databases_are_said(tmp_path, ros2):
    folder = ros2.write_bag(tmp_path / "bag", {"/imu": ("sensor_msgs/msg/Imu", [(1, ros2.imu(1, (1, 2, 3)))])})
    with pytest.raises(BadFile, match="no event messages, only /imu"):
        open_events(folder)
    sqlite3.connect(tmp_path / "a.db3").execute("CREATE TABLE addresses (name TEXT)").connection.close()
    with pytest.raises(BadFile, match="without a bag's tables"):
        open_events(tmp_path / "a.db3")
