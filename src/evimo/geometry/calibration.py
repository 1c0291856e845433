"""Calibration files to cameras: whatever the program that wrote them, and the right one of several."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from evimo.arguments import path_of, size_of, word_of
from evimo.errors import BadFile, BadInput, NotFound
from evimo.geometry.calibration_numbers import is_number, sizes
from evimo.geometry.calibration_trees import FORMATS, beside, file_text, tree_of
from evimo.geometry.calibration_values import Described, Size, described_cameras
from evimo.geometry.camera import Camera

RECTIFIED = re.compile(r"camRect(\d+)")  # in DSEC's files: what remains of cam0 after rectification is camRect0
NAMES = {"fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2", "width", "height"}
COUNTS = {  # of the numbers in a file of numbers alone: what they are
    4: "fx fy cx cy",
    8: "fx fy cx cy k1 k2 p1 p2",
    9: "fx fy cx cy k1 k2 p1 p2 k3, or a matrix fx 0 cx 0 fy cy 0 0 1, before k1 k2 p1 p2 k3 or alone",
}


def load_camera(
    path: str | Path, *, size: Size | None = None, topic: str | None = None, camera: str | None = None
) -> Camera:
    """The camera that a calibration file describes. The format is recognised from the content.

    Of several cameras in a file, that named `camera` is taken; else those of the sensor's size, and of these the one
    whose topic or name shares most with `topic`.

    Args:
        path: kalibr YAML (a camera or a camchain), ROS camera_info (its YAML, or what `rostopic echo` prints), OpenCV's
            YAML, XML or JSON, which Metavision and DV write too, dv-processing JSON, DSEC's cam_to_cam.yaml, basalt
            JSON, or a text of numbers: fx fy cx cy, k1 k2 p1 p2 (EV-IMO, whose size and lens are in a `params.txt`
            beside it), k3 (the event camera dataset of RPG).
        size: height and width of the sensor in px; needed where the file does not tell it.
        topic: that of the events in their bag.
        camera: its name in the file.

    Raises:
        NotFound: no such file, or no such camera in it.
        BadFile: not a calibration, truncated, or with impossible values.
        BadInput: the size is not in the file and not given, or differs from the file's; or several cameras fit.
    """
    path = path_of(path, "a calibration")
    size = None if size is None else size_of(size, "size")
    topic = None if topic is None else word_of(topic, "topic", fix="that of the events in their bag")
    camera = None if camera is None else word_of(camera, "camera", fix="its name in the file, as in 'cam0'")
    text = file_text(path)
    plain = re.sub(r"^\s*[#%].*$", "", text, flags=re.MULTILINE)
    numbers = [word for word in re.split(r"[\s,;=\[\]()]+", plain) if word]
    if numbers and all(is_number(number) for number in numbers):
        found = [_of_numbers(path, [float(number) for number in numbers])]
    elif named := _named_numbers(numbers):
        found = described_cameras(path, named)
    else:
        found = described_cameras(path, tree_of(path, text))
    if not found:
        raise BadFile(f"{path}: no camera found in it", fix=f"give {FORMATS}")
    return _fitting(path, found if camera is None else [_named(path, found, camera)], size=size, topic=topic)


def nearest(topic: str, others: Mapping[str, str]) -> list[str]:
    """The keys of those topics that share most leading words with a topic, and at least one; the last word is left out.

    /davis/left/events shares two words with /davis/left/image_raw, and one with /davis/right/image_raw.
    """
    shared = {key: _shared(topic, other) for key, other in others.items()}
    most = max(shared.values(), default=0)
    return [key for key, count in shared.items() if count == most > 0]


def _shared(one: str, other: str) -> int:
    count = 0
    for mine, theirs in zip(_words(one), _words(other), strict=False):
        if mine != theirs:
            break
        count += 1
    return count


def _words(topic: str) -> list[str]:
    return topic.strip("/").split("/")[:-1]


def _named(path: Path, found: Sequence[Described], name: str) -> Described:
    for each in found:
        if name.lower().strip("/") in (known.lower().strip("/") for known in (*each.names, each.topic)):
            return each
    raise NotFound(f"{path}: no camera {name!r} in it", fix=f"one of: {_listed(found)}")


def _fitting(path: Path, found: Sequence[Described], *, size: Size | None, topic: str | None) -> Camera:
    """The camera of that size, and of several the one of that topic."""
    fitting = [each for each in found if None in (size, each.size) or each.size == size]
    if not fitting:
        held = ", ".join(dict.fromkeys(f"{each.size[1]}x{each.size[0]}" for each in found if each.size))
        wanted = f"{size[1]}x{size[0]}" if size else ""
        raise BadInput(
            f"{path}: calibrated for {held}, but the sensor is {wanted}", fix="the calibration of this sensor"
        )
    fitting = _of_topic(_as_recorded(fitting), topic)
    if len(fitting) > 1 and len({_built(each, size) for each in fitting}) > 1:
        raise BadInput(
            f"{path}: {len(fitting)} of its cameras fit: {_listed(fitting)}", fix="--camera NAME, one of them"
        )
    return fitting[0].camera(size)


def _built(described: Described, size: Size | None) -> Camera | str:
    """The camera, or why it is none."""
    try:
        return described.camera(size)
    except (BadFile, BadInput) as error:
        return error.problem


def _as_recorded(found: list[Described]) -> list[Described]:
    """Without the rectified twins of cameras that are there: recordings hold events as they were seen."""
    names = {each.names[0] for each in found}
    twins = {name for name in names if (match := RECTIFIED.fullmatch(name)) and f"cam{match[1]}" in names}
    return [each for each in found if each.names[0] not in twins]


def _of_topic(found: list[Described], topic: str | None) -> list[Described]:
    """Those whose topic is near, else those whose name is a word of the topic; all where that decides nothing."""
    if not topic or len(found) < 2:
        return found
    near = nearest(topic, {str(number): each.topic for number, each in enumerate(found)})
    if len(near) == 1:
        return [found[int(near[0])]]
    words = {word.lower() for word in topic.split("/")}
    return [each for each in found if words & {name.lower() for name in each.names}] or found


def _listed(found: Sequence[Described]) -> str:
    return ", ".join(each.title for each in found)


def _named_numbers(words: Sequence[str]) -> dict[str, float]:
    """Numbers by their names, one before each or all before the first; nothing of any other text."""
    names = [word.rstrip(":").lower() for word in words if not is_number(word) and word != ":"]
    values = [float(word) for word in words if is_number(word)]
    is_whole = len(names) == len(values) == len(set(names)) and {"fx", "fy", "cx", "cy"} <= set(names) <= NAMES
    return dict(zip(names, values, strict=True)) if is_whole else {}


def _of_numbers(path: Path, numbers: list[float]) -> Described:
    """A text of numbers alone: the last two of four coefficients are p1 p2, as EV-IMO's maintainer says of its own."""
    is_matrix = len(numbers) in (9, 13, 14) and numbers[6:9] == [0, 0, 1] and numbers[1] == numbers[3] == 0
    if len(numbers) not in COUNTS and not is_matrix:
        raise BadFile(
            f"{path}: {len(numbers)} numbers are no calibration",
            fix=f"one of: {'; '.join(COUNTS.values())}; or {FORMATS}",
        )
    first = 9 if is_matrix else 4
    matrix, distortion = numbers[:first], numbers[first:]
    params = dict(re.findall(r"^\s*(\w+)\s*:\s*(\S+)", beside(path, "params.txt"), re.MULTILINE))
    size = None
    if "res_x" in params and "res_y" in params:  # there, x counts rows
        columns, rows = sizes(path.with_name("params.txt"), [params["res_y"], params["res_x"]])
        size = rows, columns
    return Described(path, (path.stem,), matrix, size=size, distortion=distortion, lens=params.get("dist_model"))
