"""The fixed parts of a frame: title bars with their legends, the wheel of directions."""

import numpy as np

from evimo.viewing.colours import (
    CARD,
    DEPTH_RANGE,
    MOVING_WITHOUT_ID,
    MUTED,
    NEGATIVE,
    POSITIVE,
    RGB,
    STATIC,
    Image,
    depth_table,
    direction_colours,
)
from evimo.viewing.layout import Box, Layout
from evimo.viewing.maps import FILL, hatch, stripes
from evimo.viewing.strokes import PLAIN, SMALL, TITLE, swatch, text_width, write, z_sign

SWATCH = 11


def titles(image: Image, layout: Layout) -> None:
    """Write the four title bars of estimates with the legends that never change, in place."""
    names = ("Events", "Moving objects", "Relative depth", "Object velocity")
    for name, header in zip(names, layout.headers, strict=True):
        title(image, header, name)
    events, mask, depth, velocity = layout.headers
    polarities(image, events)
    _swatches(image, mask, {"moving, no id": _over_card(MOVING_WITHOUT_ID), "no data": hatch((SWATCH, SWATCH))})
    depths(image, depth, bounds=DEPTH_RANGE, unit="mean depths")
    hint(image, velocity, "id: speed, mean depths/s")


def title(image: Image, header: Box, name: str) -> int:
    """Write the name of a panel at the left of its title bar, in place; returns the column behind it."""
    return write(image, name, (header.x, header.y + 16), size=TITLE, bold=True)


def hint(image: Image, header: Box, text: str) -> None:
    """Explain a panel in a few words at the right of its title bar, in place."""
    write(image, text, (header.right, header.y + 16), colour=MUTED, align="right")


def polarities(image: Image, header: Box) -> None:
    """The colours of events at the right of a title bar, in place."""
    _swatches(image, header, {"brighter": POSITIVE, "darker": NEGATIVE})


def static(image: Image, header: Box) -> int:
    """What stripes and hatching mean where objects are true, in place; returns the first column."""
    lines = np.where(stripes((SWATCH, SWATCH))[..., None], np.array(STATIC, np.uint8), np.array(CARD, np.uint8))
    return _swatches(image, header, {"static clutter": lines, "no data": hatch((SWATCH, SWATCH))})


def depths(image: Image, header: Box, *, bounds: tuple[float, float], unit: str) -> None:
    """The colour bar at the right of a title bar, near on the left, in place; every factor of two has a tick.

    From the far end on, those have a number whose number does not touch the last one.
    """
    width = 150
    x, y = header.right - width - 12, header.y + 5
    near, far = np.log2(bounds)
    image[y : y + 9, x : x + width] = depth_table()[np.linspace(0, 255, width).astype(int)]
    free = header.right + width
    for power in range(round(far), round(near) - 1, -1):
        column, number = x + round((power - near) / (far - near) * (width - 1)), f"{2.0**power:g}"
        image[y + 9 : y + 12, column] = MUTED
        reach = text_width(number, size=SMALL) // 2 + 2
        if column + reach <= free:
            write(image, number, (column, y + 19), size=SMALL, colour=MUTED, align="centre")
            free = column - reach
    write(image, unit, (x - 12, y + 4), size=SMALL, colour=MUTED, align="right")


def wheel(image: Image, box: Box) -> None:
    """The colours of directions, with their names around them, in place."""
    radius = box.height // 2 - 16
    rows, columns = np.mgrid[-radius : radius + 1, -radius : radius + 1].astype(float)
    disc = direction_colours(np.stack([columns, rows], axis=-1), full=radius)
    x, y = box.x + box.width // 2, box.y + box.height // 2
    inside = np.clip(radius + 0.5 - np.hypot(rows, columns), 0, 1)[..., None]
    part = image[y - radius : y + radius + 1, x - radius : x + radius + 1]
    part[:] = np.rint(part * (1 - inside) + disc * inside).astype(np.uint8)
    write(image, "up", (x, y - radius - 9), size=SMALL, colour=MUTED, align="centre")
    write(image, "down", (x, y + radius + 9), size=SMALL, colour=MUTED, align="centre")
    write(image, "right", (x + radius + 6, y), size=SMALL, colour=MUTED)
    write(image, "left", (x - radius - 6, y), size=SMALL, colour=MUTED, align="right")


def depth_signs(image: Image, at: tuple[int, int]) -> None:
    """The signs of motion along the optical axis and what they mean, in place."""
    x, y = at
    for name, towards in (("towards", True), ("away", False)):
        z_sign(image, np.array([x + 8.0, y]), towards=towards)
        x = write(image, name, (x + 22, y), size=PLAIN, colour=MUTED) + 24


def _swatches(image: Image, header: Box, entries: dict[str, RGB | Image]) -> int:
    """Names with their colours, or pictures of 11 x 11 px, at the right of a title bar; returns the first column."""
    first = header.right + 14 - sum(text_width(name) + 30 for name in entries)
    x, y = first, header.y + 16
    for name, fill in entries.items():
        x = write(image, name, (swatch(image, (x, y), fill=fill), y), colour=MUTED) + 14
    return first


def _over_card(colour: RGB) -> Image:
    """A colour as it looks inside a mask."""
    return np.rint(np.array(colour) * FILL + np.array(CARD) * (1 - FILL)).astype(np.uint8)
