"""Paths of poses that are not in order."""

import numpy as np

from evimo.recordings.paths import paths_of


def test_a_sample_that_goes_back_in_time_leaves_what_moves_as_it_is():
    """The object rests for 2 s and then moves at 0.5 m/s; in between one sample carries the time of the start."""
    times_us = np.arange(0, 4_000_000, 5_000)
    placed = np.tile(np.eye(4), (len(times_us), 1, 1))
    placed[:, 0, 3] = 0.5 * np.maximum(times_us * 1e-6 - 2, 0)
    disordered = times_us.copy()
    disordered[300:500] = times_us[0]
    asked_us = np.arange(50_000, 3_900_000, 10_000)
    asked_us = asked_us[(asked_us < 1_450_000) | (asked_us > 2_600_000)]
    paths = paths_of(disordered, np.tile(np.eye(4), (len(times_us), 1, 1)), {1: placed})
    assert (np.diff(paths.steps_us) > 0).all()
    np.testing.assert_array_equal(paths.motions(asked_us)["moving"][:, 0], asked_us > 2_000_000)
