"""Recordings in the very layouts of EV-IMO and EVIMO2, pickles and traps included, of the known scene.

Written as the datasets' own programs write them: by NumPy with pickling, from the projector's formula.
"""

import struct
from functools import cache

import cv2
import numpy as np
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation
from tests.recordings.known_scene import CAMERA, events, poses, truth

from evimo.recordings.pose_words import frame_words, in_v1_axes, trajectory_words

STOP_US = 700_000
# The frames are jittered, as the datasets' are; the ids skip one, and one frame is there twice.
TIMES_US = np.array([200_000, 226_000, 249_500, 275_000, 301_000, 324_000, 350_000, 376_500, 400_000, 425_000])
TIMES_US = np.concatenate((TIMES_US, 450_000 + 25_000 * np.arange(8)))
V2_IDS = (5, 9, 24)


def renamed(entries, ids):
    """The same entries with other numbers of objects."""
    names = dict(zip("123", map(str, ids), strict=True))
    return [{names.get(key, key): value for key, value in entry.items()} for entry in entries]


def v1_numbers(camera=CAMERA):
    """The intrinsics that the first version's projector gives these maps with."""
    return {
        **{"fx": camera.fy, "fy": camera.fx, "cx": camera.height - 1 - camera.cy, "cy": camera.width - 1 - camera.cx},
        **dict(zip(("k1", "k2", "k3", "k4"), camera.distortion, strict=True)),
        **{"res_x": camera.height, "res_y": camera.width},
    }


def v1_meta(times_us=TIMES_US, numbers=None):
    frames = frame_words(in_v1_axes(poses(times_us)))
    for skipped, frame in enumerate(frames):
        frame["id"] = skipped + (skipped > 3)
        frame["gt_frame"] = f"depth_mask_{frame['id']}.png"
        frame["cam"]["vel"] = frame["cam"]["pos"]
    trajectory = trajectory_words(in_v1_axes(poses(np.arange(0, STOP_US, 5000))))
    return {"meta": numbers or v1_numbers(), "frames": frames, "full_trajectory": trajectory}


def v2_meta(times_us=TIMES_US, camera=CAMERA):
    k1, k2, p1, p2 = camera.distortion
    numbers = {"fx": camera.fx, "fy": camera.fy, "cx": camera.cx, "cy": camera.cy, "dist_model": "radtan"}
    numbers |= {"k1": k1, "k2": k2, "k3": 0.0, "k4": 0.0, "p1": p1, "p2": p2}
    numbers |= {"res_x": camera.width, "res_y": camera.height, "ros_time_offset": 1.6e9}
    frames = renamed(frame_words(poses(times_us)), V2_IDS)
    trajectory = renamed(trajectory_words(poses(np.arange(0, STOP_US, 5000))), V2_IDS)
    return {"meta": numbers, "frames": frames, "full_trajectory": trajectory, "imu": {"/imu": []}}


@cache
def maps(ids=(1, 2, 3)):
    truths = [truth(t, ids) for t in TIMES_US]
    return np.stack([each.depth for each in truths]) * 1000, np.stack([each.ids for each in truths])


@cache
def all_events():
    return events(0, STOP_US, number=20_000)


def event_rows(kind=np.float32):
    found = all_events()
    return np.stack((found.t * 1e-6, found.x, found.y, found.p > 0), axis=1).astype(kind)


def v1_npz(path, *, floats=True, meta=None, **changes):
    """As evimo-gen.py wrote it in 2019 (float64 maps), or later (uint16)."""
    depth, ids = maps()
    if floats:
        depth = np.where(depth > 10, depth, np.nan)
        mask = ids * (1000.0 + np.where(np.arange(ids.shape[2]) % 2, 1e-4, -1e-4))  # cut off, half would be one less
    else:
        depth, mask = np.rint(depth).astype(np.uint16), ids.astype(np.uint16) * 1000
    arrays = {
        "events": event_rows(),
        "index": np.array([0, 1, 19_999], np.uint32),  # wrong, and never used
        "discretization": np.array(0.01),
        "K": np.array([[1.0, 0, 2], [0, 1, 3], [0, 0, 1]]),
        "D": np.array(CAMERA.distortion) / 10,
        "depth": depth,
        "mask": mask,
        "meta": meta if isinstance(meta, np.ndarray) else np.array(v1_meta() if meta is None else meta, object),
    }
    arrays |= changes
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(path, **{name: values for name, values in arrays.items() if values is not None})
    return path


def v2_npz(path, *, meta=None, **changes):
    """EVIMO2's first layout."""
    depth, ids = maps(ids=V2_IDS)
    shape = {"depth": np.rint(depth).astype(np.uint16), "mask": ids.astype(np.uint16) * 1000}
    path.parent.mkdir(parents=True, exist_ok=True)
    info = {"K": np.eye(3), "D": np.zeros(4), "index": np.zeros(1, np.uint32), "discretization": 0.01}
    meta = np.array(v2_meta() if meta is None else meta, object)
    arrays = {"events": event_rows(), "classical": np.array(None, object), "meta": meta, **shape, **info}
    np.savez_compressed(path, **arrays | changes)
    return path


def v2_folder(folder, *, meta=None, unknown=(), inverted=False, **changes):
    """EVIMO2's second layout; `unknown` frames stay in `meta` without anything."""
    folder.mkdir(parents=True)
    meta = v2_meta() if meta is None else meta
    depth, ids = maps(ids=V2_IDS)
    keys = [k for k in range(len(TIMES_US)) if k not in unknown]
    for k in unknown:
        meta["frames"][k] = {name: meta["frames"][k][name] for name in ("id", "ts")}
    for frame in meta["frames"]:
        frame["id"] += 120
    rows = event_rows(np.float64)
    np.save(folder / "dataset_events_t.npy", rows[:, 0].astype(changes.get("t_kind", np.float32)))
    np.save(folder / "dataset_events_xy.npy", rows[:, 1:3].astype(np.uint16))
    np.save(folder / "dataset_events_p.npy", (rows[:, 3] != inverted).astype(np.uint8))
    np.savez_compressed(
        folder / "dataset_depth.npz", **{f"depth_{k:010d}": np.rint(depth[k]).astype(np.uint16) for k in keys}
    )
    np.savez_compressed(
        folder / "dataset_mask.npz", **{f"mask_{k:010d}": ids[k].astype(np.uint16) * 1000 for k in keys}
    )
    np.savez_compressed(folder / "dataset_classical.npz", empty=np.array(None, object))
    np.savez_compressed(
        folder / "dataset_info.npz",
        meta=np.array(meta, object),
        K=np.array([[CAMERA.fx, 0, CAMERA.cx], [0, CAMERA.fy, CAMERA.cy], [0, 0, 1]]),
        D=np.zeros(4),
        index=np.zeros(1, np.uint32),
        discretization=0.01,
    )
    return folder


def v1_text(folder, *, meta=None):
    """EV-IMO's text: events.txt, meta.txt and pictures."""
    (folder / "img").mkdir(parents=True)
    found = all_events()
    lines = [f"{t * 1e-6:.9f} {x} {y} {p:d}" for t, x, y, p in zip(found.t, found.x, found.y, found.p > 0, strict=True)]
    (folder / "events.txt").write_text("\n".join(lines) + "\n")
    meta = v1_meta() if meta is None else meta
    (folder / "meta.txt").write_text("\n".join(("{", *(f"'{key}': {value}," for key, value in meta.items()), "}")))
    depth, ids = maps()
    for k, frame in enumerate(meta["frames"]):
        mm = np.rint(depth[k]).astype(np.uint16)
        cv2.imwrite(
            str(folder / "img" / frame["gt_frame"]), np.stack((mm, mm, ids[k].astype(np.uint16) * 1000), axis=2)
        )
    (folder / "config.txt").write_text("true\ntrue\nfalse\n")
    return folder


# ---- the bag: Vicon's poses of a rig, which sees through a camera that is mounted somehow ---------------------------

EPOCH_US = 1_600_000_000_000_000
RECEIVED_US = 7_000  # after an event's own time
OFFSET_S = 0.012
RIG_FROM_CAM = (0.05, -0.02, 0.01, 0.3, -0.2, 0.1)
UP_LEFT_BACK = np.array([[0.0, -1, 0, 0], [-1, 0, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]])


def stamp(t_us):
    return struct.pack("<II", int(t_us) // 10**6, int(t_us) % 10**6 * 1000)


def text(word):
    return struct.pack("<I", len(word)) + word.encode()


def subject(t_us, name, pose, occluded=False):
    x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat()
    numbers = struct.pack("<7d", *pose[:3, 3], x, y, z, w)
    return (
        struct.pack("<I", 1)
        + stamp(t_us)
        + text("/vicon")
        + text(name)
        + struct.pack("<?", occluded)
        + numbers
        + bytes(4)
    )


def array_message(part):
    body = b"".join(
        struct.pack("<HH", x, y) + stamp(t + EPOCH_US) + struct.pack("<?", p > 0)
        for x, y, t, p in zip(part.x.tolist(), part.y.tolist(), part.t.tolist(), part.p.tolist(), strict=True)
    )
    return (
        struct.pack("<I", 7) + stamp(part.t[0] + EPOCH_US) + text("cam") + struct.pack("<III", 60, 80, len(part)) + body
    )


def v1_bag(folder, *, lost=(), again_us=0, rig_as=lambda pose: pose):
    """EV-IMO's bag with its three text files; object 2 is occluded from and to these times, µs.

    The first events come again, so much later, where that is not 0.
    """
    folder.mkdir(parents=True)
    types = get_typestore(Stores.ROS1_NOETIC)
    found, path = all_events(), folder / "seq_00.bag"
    extrinsic = np.eye(4)
    extrinsic[:3, :3] = Rotation.from_euler("xyz", RIG_FROM_CAM[3:]).as_matrix()
    extrinsic[:3, 3] = RIG_FROM_CAM[:3]
    messages = []
    for first in range(0, len(found), 500):
        part = found.between(
            int(found.t[first]), int(found.t[min(first + 500, len(found) - 1)]) + (first + 500 >= len(found))
        )
        if len(part):
            messages.append((int(part.t[0]) + EPOCH_US + RECEIVED_US, "/dvs/events", array_message(part)))
    if again_us:
        part = found.part(0, 500)
        late = type(part)(part.x, part.y, part.t + again_us, part.p)
        messages.append((STOP_US + EPOCH_US + RECEIVED_US, "/dvs/events", array_message(late)))
    times = np.arange(0, STOP_US, 5000)
    track = in_v1_axes(poses(times))
    for k, t in enumerate(times.tolist()):
        # The dataset's clock begins when the first message was received, and poses are shifted by the offset.
        at_us = t + EPOCH_US + RECEIVED_US - round(OFFSET_S * 1e6)
        rig = track.world_from_cam[k] @ np.linalg.inv(extrinsic)
        messages.append((at_us, "/vicon/DVS346", subject(at_us, "DVS346", rig_as(rig))))
        for column, name in enumerate(("Object_1", "Object_2")):
            body = track.world_from_cam[k] @ track.cam_from_object[k, column]
            hidden = bool(column == 1 and lost and lost[0] <= t < lost[1])
            messages.append((at_us, f"/vicon/{name}", subject(at_us, name, body if not hidden else np.eye(4), hidden)))
    kinds = {"/dvs/events": "dvs_msgs/msg/EventArray"}
    with Writer(path) as writer:
        connections = {}
        for t_us, topic, payload in sorted(messages, key=lambda each: each[0]):
            if topic not in connections:
                kind = kinds.get(topic, "vicon/msg/Subject")
                connections[topic] = writer.add_connection(topic, kind, msgdef="string s\n", md5sum="0" * 32)
            writer.write(connections[topic], t_us * 1000, payload)
    del types
    numbers = v1_numbers()
    (folder / "calib.txt").write_text(
        " ".join(str(numbers[name]) for name in ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"))
    )
    (folder / "extrinsics.txt").write_text(f"{' '.join(map(str, RIG_FROM_CAM))}\n0 0 0 1 0 0 0\n{OFFSET_S}\n0\n")
    (folder / "config.txt").write_text("true\ntrue\nfalse\n")
    return path
