import numpy as np

from evimo.recordings.prepared import EVENT_NAMES, NAMES, open_prepared, prepare
from evimo.simulate.dataset import DatasetPlan, write_recording
from evimo.simulate.plan import RecordingPlan
from evimo.simulate.prepared import filmed
from evimo.simulate.recording import simulate_recording


def test_what_is_filmed_into_memory_is_what_is_read_from_a_folder(tmp_path):
    plan = DatasetPlan(
        first=RecordingPlan(seed=3, set_number=1, seconds=0.075, camera="evimo", size=(48, 64)), minutes=1
    )
    stored = open_prepared(prepare(write_recording(plan, tmp_path, 3)))
    made = filmed(simulate_recording(RecordingPlan(seed=3, set_number=1, seconds=0.075, camera="evimo", size=(48, 64))))
    assert len(made) == 3 and len(made.event_t) > 100
    np.testing.assert_allclose(made.intrinsics, stored.intrinsics)
    for name in {*NAMES, *EVENT_NAMES} - {"depth", "flow"}:
        np.testing.assert_allclose(getattr(made, name), getattr(stored, name), atol=1e-6, err_msg=name)
    known = stored.depth > 0  # files hold whole millimetres
    np.testing.assert_allclose(made.depth[known], stored.depth[known], atol=0.002, rtol=0.002)
    np.testing.assert_allclose(made.flow, stored.flow, atol=0.01, rtol=0.02)
