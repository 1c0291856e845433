import h5py
import numpy as np
import pytest

from evimo.events.events import Events
from evimo.recordings.estimate import EventLabels
from evimo.streaming.events_file import CHUNK, COLUMNS, EventsFile


def labels_of(count: int, *, seed: int) -> EventLabels:
    rng = np.random.default_rng(seed)
    x, y = rng.integers(0, 1280, (2, count)).astype(np.uint16)
    t = 2**40 + seed * 25_000 + np.sort(rng.integers(0, 25_000, count))
    return EventLabels(
        Events(x, y, t, rng.choice(np.array([-1, 1], np.int8), count)), rng.integers(0, 256, count).astype(np.uint8)
    )


@pytest.mark.parametrize("counts", [[], [0], [5, 0, 7], [CHUNK - 1, 3, 2 * CHUNK]])
def test_what_is_written_is_read_back(tmp_path, counts):
    parts = [labels_of(count, seed=seed) for seed, count in enumerate(counts)]
    file = EventsFile(tmp_path / "events.h5", attributes={"model": "tiny"})
    for part in parts:
        file.write(part)
    file.close()
    with h5py.File(tmp_path / "events.h5") as saved:
        assert saved.attrs["model"] == "tiny"
        assert list(COLUMNS) == sorted(saved, key=list(COLUMNS).index)
        for name, (dtype, meaning) in COLUMNS.items():
            assert saved[name].shape == (sum(counts),)
            assert saved[name].dtype == dtype
            assert saved[name].compression == "gzip"
            assert saved[name].attrs["meaning"] == meaning
        if parts:
            columns = {"t_us": "t", "x": "x", "y": "y", "p": "p"}
            for name, field in columns.items():
                expected = np.concatenate([getattr(part.events, field) for part in parts])
                np.testing.assert_array_equal(saved[name], expected)
            np.testing.assert_array_equal(saved["object"], np.concatenate([part.objects for part in parts]))
