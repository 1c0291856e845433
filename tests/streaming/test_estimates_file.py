import h5py
import numpy as np
import pytest

from evimo.recordings.estimate import Estimate
from evimo.streaming.estimates_file import GROWTH, EstimatesFile

SHAPE = (6, 8)


def estimate_of(number: int, *, valid: np.ndarray) -> Estimate:
    rng = np.random.default_rng(number)
    return Estimate(
        t_us=25_000 * number + 12_500,
        start_us=25_000 * number,
        stop_us=25_000 * (number + 1),
        moving_probability=rng.random(SHAPE, np.float32),
        ids=rng.integers(0, 256, SHAPE).astype(np.uint8),
        rel_depth=rng.uniform(0.1, 30, SHAPE).astype(np.float32),
        flow=np.zeros((2, *SHAPE), np.float32),
        confidence=rng.random(SHAPE, np.float32),
        valid=valid,
        ego=rng.normal(size=6),
        objects=(),
    )


@pytest.mark.parametrize("count", [0, 1, GROWTH + 3])
def test_what_is_written_is_read_back(tmp_path, count):
    valid = np.eye(*SHAPE, dtype=np.bool_)
    estimates = [estimate_of(number, valid=valid) for number in range(count)]
    file = EstimatesFile(tmp_path / "maps.h5", valid, attributes={"model": "tiny", "recording": "K\udcfcche.raw"})
    for estimate in estimates:
        file.write(estimate)
    file.close()
    with h5py.File(tmp_path / "maps.h5") as saved:
        assert (saved.attrs["model"], saved.attrs["recording"]) == ("tiny", r"K\udcfcche.raw")
        assert set(saved) == {
            "t_us",
            "has_events",
            "ego",
            "moving_probability",
            "ids",
            "rel_depth",
            "confidence",
            "valid",
        }
        assert all(saved[name].attrs["meaning"] for name in saved)
        assert saved["moving_probability"].dtype == saved["ids"].dtype == np.uint8
        assert saved["rel_depth"].dtype == np.float16
        assert saved["t_us"].dtype == np.int64
        assert saved["t_us"].shape == (count,)
        assert saved["ids"].shape == (count, *SHAPE)
        np.testing.assert_array_equal(saved["valid"], valid)
        for number, estimate in enumerate(estimates):
            assert saved["t_us"][number] == estimate.t_us
            np.testing.assert_array_equal(saved["ids"][number], estimate.ids)
            np.testing.assert_array_equal(saved["ego"][number], estimate.ego)
            np.testing.assert_allclose(
                saved["moving_probability"][number] / 255, estimate.moving_probability, atol=0.5 / 255
            )
            np.testing.assert_allclose(saved["confidence"][number] / 255, estimate.confidence, atol=0.5 / 255)
            np.testing.assert_allclose(saved["rel_depth"][number], estimate.rel_depth, rtol=1e-3)
