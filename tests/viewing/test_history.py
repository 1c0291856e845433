import numpy as np
import pytest
from pytest import approx

from evimo.viewing.colours import X_AXIS, Y_AXIS
from evimo.viewing.history import History, plot, round_limit
from evimo.viewing.layout import Box
from evimo.viewing.moment import estimated

SIZE = (4, 6)


@pytest.mark.parametrize(
    ("value", "limit"), [(0, 0.1), (0.1, 0.1), (0.11, 0.2), (0.4, 0.5), (0.7, 1), (1, 1), (30, 50)]
)
def test_limits_are_round_and_not_below(value, limit):
    assert round_limit(value) == approx(limit)


def test_history_holds_two_seconds(make_estimate):
    history = History()
    for k in range(200):
        history.add(estimated(make_estimate(SIZE, t_us=k * 25_000, ego=np.full(6, float(k)))))
    assert history.ages_s[[0, -1]].tolist() == [2.0, 0.0]
    assert history.twists[[0, -1], 0].tolist() == [119.0, 199.0]


def test_history_starts_anew_when_time_jumps_back(make_estimate):
    history = History()
    for t_us in (50_000, 75_000, 25_000):
        history.add(estimated(make_estimate(SIZE, t_us=t_us)))
    assert history.ages_s.tolist() == [0.0]


def test_the_fastest_object_of_two_seconds_sets_the_arrows(make_estimate, make_square):
    history = History()
    history.add(estimated(make_estimate(SIZE, make_square(1, (0, 0, 1, 1), (0.0, 0.3, 0.4)), t_us=0)))
    history.add(estimated(make_estimate(SIZE, t_us=1_000_000)))
    assert history.speed_limit == 0.5
    history.add(estimated(make_estimate(SIZE, t_us=2_500_000)))
    assert history.speed_limit == 0.1


def test_the_fastest_flow_of_two_seconds_sets_its_colours(make_estimate):
    history = History()
    for t_us, flow_px in ((0, 130.0), (1_000_000, 3.0)):
        history.add(estimated(make_estimate(SIZE, t_us=t_us)), flow_px=flow_px)
    assert history.flow_limit == 150
    history.add(estimated(make_estimate(SIZE, t_us=2_500_000)))
    assert history.flow_limit == 10


def rows_of(image, colour):
    return np.nonzero(np.all(image == colour, axis=-1))[0]


def test_positive_is_up_and_negative_is_down():
    image = np.zeros((150, 200, 3), np.uint8)
    values = np.tile([[0.9, -0.9, 0.0]], (5, 1))
    plot(image, Box(0, 0, 200, 150), np.linspace(2, 0, 5), values)
    curves = image[:112]
    assert rows_of(curves, X_AXIS).max() < 30
    assert rows_of(curves, Y_AXIS).min() > 80


def test_the_present_is_at_the_right():
    image = np.zeros((150, 200, 3), np.uint8)
    plot(image, Box(0, 0, 200, 150), np.array([2.0, 0.0]), np.array([[-1.0, 0, 0], [1.0, 0, 0]]))
    rows, columns = np.nonzero(np.all(image[:112] == X_AXIS, axis=-1))
    assert np.corrcoef(rows, columns)[0, 1] < -0.99
    assert columns.max() > 185
