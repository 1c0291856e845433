"""What a recording says of its own kind: the groups that it is scored in, and which of its objects are familiar."""

from collections.abc import Mapping
from typing import Any, cast

FAST_SET = 6  # of the paper's Table I: its sequences are named after their motion, not after what is behind it


def groups_of(meta: Mapping[str, Any]) -> tuple[str, ...]:
    """Names of the groups under which a recording's scores are reported once more: its set, its background if known.

    The background of a recording that only knows its room is the room, or fast motion.
    """
    number = meta.get("set", "unknown")
    background = meta.get("background")
    if background is None and meta.get("room"):
        background = "fast" if number == FAST_SET else meta["room"]
    return (f"set {number}",) if background is None else (f"set {number}", f"background {background}")


def familiar_objects(meta: Mapping[str, Any]) -> dict[int, bool]:
    """Which object is of a family of shapes that training has seen; nothing where the recording does not say.

    The field `objects_seen` lists the ids that are, all others are not; or it says it of each id.
    """
    told = meta.get("objects_seen")
    if isinstance(told, Mapping):
        return {int(key): bool(seen) for key, seen in cast(Mapping[Any, Any], told).items()}
    return {} if told is None else {key: key in told for key in range(1, 256)}
