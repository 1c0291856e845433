import numpy as np
import pytest

from evimo.streaming.identities import LASTING, MEMORY, Identities

SIZE = (40, 120)


def labelled(*boxes: tuple[int, int, int, int]) -> np.ndarray:
    """Label 1, 2, … in each box x0, y0, x1, y1 (exclusive)."""
    labels = np.zeros(SIZE, np.uint8)
    for number, (x0, y0, x1, y1) in enumerate(boxes, start=1):
        labels[y0:y1, x0:x1] = number
    return labels


def at(ids: np.ndarray, x: int, y: int) -> int:
    return int(ids[y, x])


def test_ids_stay_when_the_order_of_labels_changes():
    identities = Identities()
    first = identities.follow(labelled((10, 10, 20, 20), (50, 10, 60, 20)))
    second = identities.follow(labelled((51, 10, 61, 20), (11, 10, 21, 20)))
    assert at(first, 15, 15) == at(second, 15, 15) == 1
    assert at(first, 55, 15) == at(second, 55, 15) == 2


def test_flicker_does_not_last():
    identities = Identities()
    for turn in range(2 * LASTING):
        boxes = [(10, 10, 20, 20)] + [(50, 10, 60, 20)] * (turn < LASTING - 1) + [(80, 30, 90, 40)] * (turn % 2)
        identities.follow(labelled(*boxes))
    assert (identities.given, identities.lasting) == (3, 2)  # one was always there, one every other time


def test_two_that_pass_each_other_keep_their_ids():
    identities = Identities()
    for step in range(0, 80, 4):
        ids = identities.follow(labelled((5 + step, 5, 25 + step, 19), (95 - step, 21, 115 - step, 35)))
        assert (at(ids, 15 + step, 10), at(ids, 105 - step, 30)) == (1, 2)
    assert identities.given == 2


def test_a_short_loss_keeps_the_id_and_a_long_one_does_not():
    identities = Identities()
    for lost, expected in ((MEMORY, 1), (MEMORY + 1, 2)):
        box = (10, 10, 20, 20)
        identities.follow(labelled(box))
        for _ in range(lost):
            assert not identities.follow(labelled()).any()
        assert at(identities.follow(labelled(box)), 15, 15) == expected


def test_one_that_splits_gives_its_id_to_the_larger_part():
    identities = Identities()
    identities.follow(labelled((10, 10, 40, 20)))
    ids = identities.follow(labelled((10, 10, 18, 20), (20, 10, 40, 20)))
    assert (at(ids, 30, 15), at(ids, 12, 15)) == (1, 2)


def test_two_that_merge_and_part_get_their_ids_back():
    identities = Identities()
    apart = labelled((10, 10, 30, 20), (31, 10, 45, 20))
    identities.follow(apart)
    for _ in range(MEMORY):
        merged = identities.follow(labelled((10, 10, 45, 20)))
        assert at(merged, 40, 15) == 1
    ids = identities.follow(apart)
    assert at(ids, 15, 15) == 1
    assert identities.given in (2, 3)  # the smaller one's place was painted over: it may count as new


def test_ids_are_never_in_two_places_and_are_used_again_oldest_first():
    identities = Identities()
    seen: list[int] = []
    for turn in range(600):
        x = 10 * (turn % 12)
        ids = identities.follow(labelled((x, 0, x + 5, 5)))
        seen.append(at(ids, x, 0))
    assert seen[:255] == list(range(1, 256))
    assert seen[255:510] == list(range(1, 256))


@pytest.mark.parametrize("seed", range(3))
def test_every_region_has_its_own_id_even_when_all_are_taken(seed):
    identities, rng = Identities(), np.random.default_rng(seed)
    for _ in range(12):
        count = int(rng.integers(150, 256))
        labels = np.zeros(SIZE, np.uint8)
        places = rng.permutation(SIZE[0] // 4 * (SIZE[1] // 4))[:count]
        for number, place in enumerate(places, start=1):
            y, x = divmod(int(place), SIZE[1] // 4)
            labels[4 * y : 4 * y + 3, 4 * x : 4 * x + 3] = number
        ids = identities.follow(labels)
        pairs = np.unique(np.stack((labels[labels > 0], ids[labels > 0])), axis=1)
        assert (pairs[1] > 0).all()
        assert len(np.unique(pairs[1])) == len(np.unique(labels[labels > 0])) == pairs.shape[1]
        assert not ids[labels == 0].any()
