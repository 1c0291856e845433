from dataclasses import replace

import numpy as np

from evimo.evaluation.protocol_scores import Protocols
from evimo.evaluation.report import MODEL
from evimo.evaluation.scoring import slice_report
from evimo.recordings.estimate import Estimate
from evimo.recordings.prediction import prediction_of


def test_a_slice_without_events_is_counted_and_spoils_no_score(sample):
    """Its motion is no number: a mean over slices would be none either."""
    shape = sample.scored.shape
    known = Estimate(
        t_us=12_500,
        start_us=0,
        stop_us=25_000,
        moving_probability=np.zeros(shape, np.float32),
        ids=np.zeros(shape, np.uint8),
        rel_depth=np.ones(shape, np.float32),
        flow=np.zeros((2, *shape), np.float32),
        confidence=np.zeros(shape, np.float32),
        valid=np.ones(shape, np.bool_),
        ego=np.zeros(6),
        objects=(),
    )
    silent = replace(known, has_events=False, ego=np.full(6, np.nan), valid=np.zeros(shape, np.bool_))
    one, other = (
        slice_report(prediction_of(each), sample, {MODEL: Protocols()}, density_threshold=1.0)
        for each in (known, silent)
    )
    both = one + other
    assert both.rows == one.rows
    assert (both.counts["slices"], both.counts["slices without events"]) == (1, 1)
