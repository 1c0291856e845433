"""Bytes that are missing inside a RAW file cost the words around them, not all that follow."""

from collections import Counter

import numpy as np
import pytest

from evimo.events.events import Events
from evimo.formats import open_events
from evimo.formats.prophesee_sense import evt3_sense
from evimo.formats.realigning import found_loss

SIZE = (480, 640)
HEADS = {"evt2": b"% evt 2.0\n", "evt21": b"% evt 2.1\n", "evt3": b"% evt 3.0\n"}


@pytest.fixture(scope="module")
def many():
    draw, count = np.random.default_rng(5), 30_000
    x, y = draw.integers(0, SIZE[1], count), draw.integers(0, SIZE[0], count)
    t = 12_000_000 + np.sort(draw.integers(0, 1_500_000, count))
    return Events(x.astype(np.uint16), y.astype(np.uint16), t, draw.choice([-1, 1], count).astype(np.int8))


@pytest.fixture
def cost(tmp_path, encoded, many, rows):
    """How many events a change of the bytes costs, how many come that were not there, and how many are said lost."""

    def of(kind, change):
        words, _ = getattr(encoded, kind)(many)
        (tmp_path / "a.raw").write_bytes(HEADS[kind] + change(words.tobytes()))
        recording = open_events(tmp_path / "a.raw", sensor=SIZE)
        found, true = Counter(rows(recording)), Counter(rows([many]))
        return (true - found).total(), (found - true).total(), recording.faults.dropped

    return of


@pytest.mark.filterwarnings("ignore::evimo.errors.EvimoWarning")
@pytest.mark.parametrize("share", [0.1, 0.5, 0.83])
@pytest.mark.parametrize("missing", [1, 2, 3, 5, 7, 1001])
@pytest.mark.parametrize("kind", ["evt2", "evt3"])
def test_missing_bytes_cost_what_is_beside_them(cost, kind, missing, share):
    def without(raw):
        at = int(len(raw) * share) | 1
        return raw[:at] + raw[at + missing :]

    gone, wrong, said = cost(kind, without)
    assert gone <= 30 + missing // 4
    assert wrong <= 45 if missing > 1000 else wrong <= 6  # of EVT 3 in the row of before, until the next row comes
    assert said > 0 or missing % {"evt2": 4, "evt3": 2}[kind] == 0


@pytest.mark.filterwarnings("ignore::evimo.errors.EvimoWarning")
@pytest.mark.parametrize("missing", range(1, 8))
def test_of_evt21_what_may_be_shifted_is_lost_rather_than_wrong(cost, missing):
    gone, wrong, said = cost("evt21", lambda raw: raw[:150_001] + raw[150_001 + missing :])
    assert wrong <= 12 and gone <= max(30, 1.5 * said) and gone < 12_000


@pytest.mark.parametrize("kind", ["evt2", "evt21", "evt3"])
def test_more_bytes_and_noise_shift_nothing_for_long(cost, kind):
    noise = np.random.default_rng(0).bytes(3000)
    gone, wrong, _ = cost(kind, lambda raw: raw[:80_000] + noise + raw[83_000:])
    assert gone < 1500 and wrong < 1500
    gone, wrong, _ = cost(kind, lambda raw: raw[:80_000] + noise[:3] + raw[80_000:])
    assert gone < 10_000 and wrong < 30


def test_nothing_is_found_in_whole_words(encoded, many):
    words, _ = encoded.evt3(many)
    for raw in (words.tobytes(), words[:300].tobytes(), words[:20].tobytes(), bytes(4000)):
        assert found_loss(memoryview(raw), np.dtype("<u2"), evt3_sense) is None
