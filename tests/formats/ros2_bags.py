"""Bags of ROS 2 as the library rosbags writes them, its own serialisation included: another road than our reader's."""

import numpy as np
from lz4.frame import compress
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.rosbag2.reader import zstd
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

PART = 100
HEAD = "std_msgs/Header header\nuint32 height\nuint32 width\n"
PACKET = HEAD + "uint64 seq\nuint64 time_base\nstring encoding\nbool is_bigendian\nuint8[] events\n"
EVENT = "uint16 x\nuint16 y\nbuiltin_interfaces/Time ts\nbool polarity\n"
PLUGINS = {"db3": StoragePlugin.SQLITE3, "mcap": StoragePlugin.MCAP}


def typestore():
    types = get_typestore(Stores.ROS2_HUMBLE)
    for package in ("dvs_msgs", "prophesee_event_msgs"):
        types.register(get_types_from_msg(EVENT, f"{package}/msg/Event"))
        types.register(get_types_from_msg(HEAD + f"{package}/Event[] events\n", f"{package}/msg/EventArray"))
    for kind in ("event_camera_msgs/msg/EventPacket", "event_array_msgs/msg/EventArray"):
        types.register(get_types_from_msg(PACKET, kind))
    return types


TYPES = typestore()


def stamp(t_us):
    return TYPES.types["builtin_interfaces/msg/Time"](sec=int(t_us) // 10**6, nanosec=int(t_us) % 10**6 * 1000)


def header(t_us, frame="camera"):
    return TYPES.types["std_msgs/msg/Header"](stamp=stamp(t_us), frame_id=frame)


def array(part, kind="dvs_msgs/msg/EventArray", size=(48, 64), frame="camera"):
    """One EventArray; its events as the library writes them, one by one."""
    event = TYPES.types[kind.replace("EventArray", "Event")]
    columns = (part.x.tolist(), part.y.tolist(), part.t.tolist(), part.p.tolist())
    events = [event(x=x, y=y, ts=stamp(t), polarity=p > 0) for x, y, t, p in zip(*columns, strict=True)]
    made = TYPES.types[kind](header=header(part.t[0], frame), height=size[0], width=size[1], events=events)
    return bytes(TYPES.serialize_cdr(made, kind))


def packet(part, kind="event_camera_msgs/msg/EventPacket", encoding="mono", frame="camera"):
    """One EventPacket with 64 bits an event, or words of EVT 3."""
    base = int(part.t[0]) * 1000
    t, x, y = (column.astype(np.uint64) for column in (part.t * 1000 - base, part.x, part.y))
    packed = t | x << np.uint64(32) | y << np.uint64(48) | (part.p > 0).astype(np.uint64) << np.uint64(63)
    if encoding == "evt3":
        base = 0
        column = 2 << 12 | (part.p > 0).astype(np.uint16) << 11 | part.x
        packed = np.stack([8 << 12 | part.t >> 12 & 0xFFF, 6 << 12 | part.t & 0xFFF, part.y, column], axis=1)
        packed = packed.astype("<u2")
    made = TYPES.types[kind](
        header=header(part.t[0], frame),
        height=48,
        width=64,
        seq=1,
        time_base=base,
        encoding=encoding,
        is_bigendian=False,
        events=np.frombuffer(packed.tobytes(), np.uint8),
    )
    return bytes(TYPES.serialize_cdr(made, kind))


def camera_info(fx, size=(48, 64)):
    types = TYPES.types
    made = types["sensor_msgs/msg/CameraInfo"](
        header=header(1),
        height=size[0],
        width=size[1],
        distortion_model="plumb_bob",
        d=np.array([0.1, 0.2, 0.3, 0.4, 0.5]),
        k=np.array([fx, 0, 31, 0, fx + 1, 23, 0, 0, 1.0]),
        r=np.zeros(9),
        p=np.zeros(12),
        binning_x=0,
        binning_y=0,
        roi=types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False),
    )
    return bytes(TYPES.serialize_cdr(made, "sensor_msgs/msg/CameraInfo"))


def imu(t_us, rate):
    types = TYPES.types
    vector, turn = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Quaternion"]
    made = types["sensor_msgs/msg/Imu"](
        header=header(t_us, "an IMU's frame"),
        orientation=turn(0.1, 0.2, 0.3, 0.9),
        orientation_covariance=np.full(9, 0.5),
        angular_velocity=vector(*rate),
        angular_velocity_covariance=np.zeros(9),
        linear_acceleration=vector(1.0, 2.0, 3.0),
        linear_acceleration_covariance=np.zeros(9),
    )
    return bytes(TYPES.serialize_cdr(made, "sensor_msgs/msg/Imu"))


def messages_of(events, make, late_us=500_000):
    """Messages of PART events each, with the times at which they were recorded, ns."""
    parts = [events.part(first, first + PART) for first in range(0, len(events), PART)]
    return [((int(part.t[-1]) + late_us) * 1000, make(part)) for part in parts]


def write_bag(folder, topics, storage="mcap", compression=None, chunk=None):
    """A folder with topics: name to (kind, [(time_ns, payload)]); compression is lz4, zstd, message or file."""
    writer = Writer(folder, version=8, storage_plugin=PLUGINS[storage])
    modes = {"zstd": CompressionMode.STORAGE, "message": CompressionMode.MESSAGE, "file": CompressionMode.FILE}
    if compression in modes:
        writer.set_compression(modes[compression], CompressionFormat.ZSTD)
    with writer:
        if compression == "lz4":
            writer.storage.compression, writer.storage.compressor = "lz4", compress
        made = {name: writer.add_connection(name, kind, typestore=TYPES) for name, (kind, _) in topics.items()}
        rows = [(time, name, payload) for name, (_, messages) in topics.items() for time, payload in messages]
        for number, (time, name, payload) in enumerate(sorted(rows)):
            writer.write(made[name], time, payload)
            if chunk and number % chunk == chunk - 1:
                writer.storage.close_chunk()
    return folder


def storage_file(folder):
    """The one file beside the metadata."""
    (file,) = (path for path in folder.iterdir() if path.name != "metadata.yaml")
    return file


def unpacked(raw):
    """What `unzstd` makes of a file."""
    return zstd.decompress(raw)
