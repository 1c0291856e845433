"""Three masks in a row, of an object whose way is known."""

import numpy as np
import pytest

from evimo.geometry.camera import Camera
from evimo.geometry.rectification import rectified
from evimo.streaming.agreement import SAY, Agreement
from evimo.streaming.inference import Answer

HEIGHT, WIDTH = 60, 80  # of the answers, at half the image's size
FOCAL = 120.0  # px of the image
PER_SLICE = 6, -4  # px of the answers, columns and rows


def _disc(column: float, row: float, sure: float = 0.95) -> np.ndarray:
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    return np.where(np.hypot(columns - column, rows - row) < 8, sure, 1 - sure).astype(np.float32)


def _answer(moving: np.ndarray, per_slice: tuple[float, float] = PER_SLICE) -> Answer:
    plane_per_s = [2 * px / FOCAL / 0.025 for px in per_slice]
    flow = np.ones((2, HEIGHT, WIDTH), np.float32) * np.float32(plane_per_s)[:, None, None]
    blank = np.ones((HEIGHT, WIDTH), np.float32)
    return Answer(moving, blank, np.zeros(6), np.zeros((3, HEIGHT, WIDTH)), flow, blank)


@pytest.fixture
def agreement():
    camera = Camera(width=2 * WIDTH, height=2 * HEIGHT, fx=FOCAL, fy=FOCAL, cx=79.5, cy=59.5)
    return Agreement(rectified(camera))


def _iou(moving: np.ndarray, truth: np.ndarray) -> float:
    called, true = moving > 0.5, truth > 0.5
    return (called & true).sum() / (called | true).sum()


def test_neighbours_find_what_the_slice_itself_nearly_missed(agreement):
    """The object is where the flow led it: the neighbours' discs come to lie on the middle one's."""
    truth = _disc(40, 30)
    unsure = _disc(40, 30, sure=0.35)  # wrong everywhere, and not sure of it
    row = [_answer(_disc(34, 34)), _answer(unsure), _answer(_disc(46, 26))]
    assert _iou(agreement.of(row).moving, truth) == 1.0


def test_along_the_flow_and_not_on_the_spot(agreement):
    """Had the flow the other sign, the discs of the neighbours would lie two steps away from this one."""
    row = [_answer(_disc(34, 34)), _answer(_disc(40, 30, sure=0.35)), _answer(_disc(46, 26))]
    backwards = row[1]._replace(flow=-row[1].flow)
    assert _iou(agreement.of([row[0], backwards, row[2]]).moving, _disc(40, 30)) < 0.5


def test_a_sure_slice_is_not_outvoted_by_one_neighbour(agreement):
    row = [_answer(_disc(34, 34)), _answer(_disc(70, 10)), None]
    assert _iou(agreement.of(row).moving, _disc(70, 10)) == 1.0


def test_neighbours_that_see_nothing_do_not_outvote_a_sure_slice(agreement):
    """Its flow may have led to the wrong place there. One that is not sure has no support, and is."""
    nothing = _answer(np.full((HEIGHT, WIDTH), 1e-3, np.float32))
    sure, unsure = (agreement.of([nothing, _answer(_disc(40, 30, sure=p)), nothing]).moving for p in (0.97, 0.7))
    assert _iou(sure, _disc(40, 30)) == 1.0
    assert not (unsure > 0.5).any()


def test_mean_of_the_log_odds(agreement):
    """By a road of its own: constant images, whose places do not matter."""
    probabilities = 0.2, 0.6, 0.9
    row = [_answer(np.full((HEIGHT, WIDTH), p, np.float32)) for p in probabilities]
    odds = np.prod([(p / (1 - p)) ** say for p, say in zip(probabilities, (SAY, 1, SAY), strict=True)])
    odds **= 1 / (1 + 2 * SAY)
    assert agreement.of(row).moving == pytest.approx(odds / (1 + odds), abs=1e-5)


def test_alone_nothing_changes(agreement):
    noise = np.random.default_rng(0).uniform(0.01, 0.99, (HEIGHT, WIDTH)).astype(np.float32)
    given = _answer(noise.copy())
    answer = agreement.of([None, given, None])
    assert answer.moving == pytest.approx(noise, abs=1e-5)
    assert np.array_equal(answer.flow, given.flow)
    assert np.array_equal(given.moving, noise)


def test_a_neighbour_that_is_wholly_sure_counts_like_one_that_nearly_is(agreement):
    """Probabilities of 0 and 1 have no log odds."""
    row = [_answer(np.zeros((HEIGHT, WIDTH), np.float32)), _answer(np.ones((HEIGHT, WIDTH), np.float32)), None]
    moving = agreement.of(row).moving
    assert np.isfinite(moving).all()
    assert (moving > 0.5).all()


def test_flow_beyond_the_image_reads_its_border(agreement):
    left = np.zeros((HEIGHT, WIDTH), np.float32) + np.float32(0.1)
    left[:, 0] = 0.9
    row = [_answer(left), _answer(np.full((HEIGHT, WIDTH), 0.5, np.float32), (500, 0)), None]
    assert (agreement.of(row).moving > 0.5).all()


@pytest.mark.parametrize("sign", [-1, 1])
def test_the_margin_behind_the_image_has_no_say(sign):
    """Networks want sides that are multiples of their stride; what they answer beyond the image is left out."""
    camera = Camera(width=2 * WIDTH - 21, height=2 * HEIGHT - 15, fx=FOCAL, fy=FOCAL, cx=69.0, cy=52.0)
    height, width = HEIGHT - 7, WIDTH - 10  # of 105 x 139 px, halved and rounded up
    moving = np.zeros((HEIGHT, WIDTH), np.float32)
    moving[:height, :width] = 0.6
    row = [_answer(moving, (6 * sign, 6 * sign)) for _ in range(3)]
    agreed = Agreement(rectified(camera)).of(row)
    assert agreed.moving == pytest.approx(np.full((height, width), 0.6), abs=1e-5)
    assert agreed.flow.shape == (2, height, width)


def test_a_probability_that_is_no_number_says_nothing(agreement):
    row = [_answer(np.full((HEIGHT, WIDTH), 0.9, np.float32)) for _ in range(3)]
    row[0].moving[:] = np.nan
    odds = 9 ** ((1 + SAY) / (1 + 2 * SAY))
    assert agreement.of(row).moving == pytest.approx(odds / (1 + odds), abs=1e-5)


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
def test_a_flow_that_is_no_number_reads_inside_the_image(agreement, wrong):
    row = [_answer(_disc(40, 30)) for _ in range(3)]
    row[1].flow[:, 10:20] = wrong
    assert np.isfinite(agreement.of(row).moving).all()
