"""The camera that a bag describes: sensor_msgs/CameraInfo."""

from functools import partial

from evimo.formats.bag_messages import Bag, MessageFields, Topic, topics
from evimo.formats.bag_topics import DAMAGED
from evimo.formats.event_file import FoundCamera, found_camera
from evimo.geometry.calibration import nearest
from evimo.geometry.calibration_values import camera_of
from evimo.geometry.camera import Camera


def bag_camera(bag: Bag, events: Topic, size: tuple[int, int]) -> FoundCamera | None:
    """The intrinsics of a CameraInfo of that size beside the events.

    The topic nearest to that of the events goes first; where several are as near and differ, none is taken: which
    camera is theirs nobody knows.
    """
    found: dict[str, FoundCamera] = {}
    for topic in topics(bag, ("sensor_msgs/CameraInfo",)):
        message = next(bag.messages(topic.connections), None)
        if message is None:
            continue
        numbers = partial(camera_info, message.payload, cdr=bag.cdr)
        one = found_camera(numbers, f"{topic.name} in the bag")
        if one and one.camera.size == size:
            found[topic.name] = one
    near = nearest(events.name, {name: name for name in found}) or list(found)
    cameras = {found[name].camera for name in near}
    return found[near[0]] if len(cameras) == 1 else None


def camera_info(payload: memoryview, *, cdr: bool) -> Camera | None:
    """Take a message apart; None where it holds zeros, a driver's way to say that nobody calibrated."""
    try:
        fields = MessageFields(payload, cdr=cdr)
        fields.stamp_ns()
        height, width = fields.numbers("2I")
        lens = fields.text()
        (count,) = fields.numbers("I")
        distortion = fields.numbers(f"{count}d") if count else ()
        fx, _, cx, _, fy, cy = fields.numbers("9d")[:6]
    except DAMAGED as error:
        raise ValueError(f"the message is damaged ({error})") from error
    return None if fx == fy == 0 else camera_of((fx, fy, cx, cy), (height, width), lens=lens, distortion=distortion)
