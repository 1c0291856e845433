"""What recordings say of themselves becomes groups and familiar objects."""

import pytest

from evimo.evaluation.kinds import familiar_objects, groups_of


@pytest.mark.parametrize(
    ("meta", "groups"),
    [
        ({}, ("set unknown",)),
        ({"set": 2, "seed": 7}, ("set 2",)),
        ({"set": 3, "part": "test", "room": "table"}, ("set 3", "background table")),
        ({"set": 6, "part": "test", "room": "boxes"}, ("set 6", "background fast")),
        ({"set": 1, "part": "test", "room": "boxes", "background": "box"}, ("set 1", "background box")),
        ({"set": 1, "room": None}, ("set 1",)),
    ],
)
def test_recordings_are_grouped_by_set_and_by_background_where_they_know_it(meta, groups):
    assert groups_of(meta) == groups


def test_recordings_say_which_objects_are_familiar_as_a_list_or_by_id():
    assert familiar_objects({}) == {}
    assert familiar_objects({"objects_seen": {"1": True, "2": False}}) == {1: True, 2: False}
    listed = familiar_objects({"objects_seen": [2]})
    assert (listed[1], listed[2]) == (False, True)
