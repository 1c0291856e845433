"""What the tools found, as files that captures read."""

import json
from collections.abc import Mapping
from pathlib import Path

from evimo.captures.entries import load_entries
from evimo.geometry.camera import Camera
from evimo.writing import save_text


def save_settings(found: Mapping[str, object], path: Path, capture: Path | None) -> None:
    """Save what was found with the keys of capture.yaml, and say how a capture comes to read it.

    Args:
        found: keys and values.
        path: of the file; an older one is replaced.
        capture: the capture.yaml that it is for, if it is for one.
    """
    lines = [line for key, value in found.items() for line in _lines(key, value, 0)]
    save_text("# Made by evimo; capture.yaml reads it by `calibration: [FILE]`.\n" + "\n".join(lines) + "\n", path)
    print(f"saved {path}")
    if capture is not None and not _lists(capture, path):
        print(f"for the capture to read it, add it to `calibration: [...]` in {capture}")


def _lines(key: str, value: object, depth: int) -> list[str]:
    """YAML of a mapping, nested ones indented, and what holds no mappings in the flow style that JSON shares."""
    indent = "  " * depth
    if isinstance(value, Mapping) and any(isinstance(inner, Mapping) for inner in value.values()):
        return [f"{indent}{key}:", *(line for name, inner in value.items() for line in _lines(name, inner, depth + 1))]
    return [f"{indent}{key}: {json.dumps(value)}"]


def _lists(capture: Path, path: Path) -> bool:
    """Whether a capture's file names this one already."""
    listed = load_entries(capture).named().get("calibration")
    return listed is not None and any(
        (capture.parent / each.text()).resolve() == path.resolve() for each in listed.entries()
    )


def camera_words(camera: Camera) -> dict[str, object]:
    """Intrinsics as capture.yaml has them."""
    return {
        **{name: getattr(camera, name) for name in ("fx", "fy", "cx", "cy", "height", "width")},
        "lens": camera.lens,
        "distortion": list(camera.distortion),
    }
