"""Windows of a long recording: what lies between them is not kept in memory."""

import numpy as np

from evimo.calibrating import event_images
from evimo.events.events import Events


def test_windows_far_apart_hold_the_same_events_and_keep_no_others(monkeypatch):
    t = np.sort(np.random.default_rng(1).integers(0, 1_000_000, 20_000))
    zeros = np.zeros(len(t), np.uint16)
    whole = Events(zeros, zeros, t, np.ones(len(t), np.int8))
    longest, joined = [], event_images.joined
    monkeypatch.setattr(event_images, "joined", lambda parts: longest.append(sum(map(len, parts))) or joined(parts))
    found = list(
        event_images.windows(
            (whole.part(at, at + 200) for at in range(0, len(t), 200)), window_us=3_000, every_us=300_000
        )
    )
    starts = t[0] + 300_000 * np.arange(4)
    for events, start in zip(found, starts, strict=True):
        np.testing.assert_array_equal(events.t, t[(t >= start) & (t < start + 3_000)])
    assert max(longest) < 1_000
