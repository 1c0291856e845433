import pickle

import pytest

from evimo.errors import BadFile, BadInput, MissingExtra, NotFound


@pytest.mark.parametrize("kind", [BadFile, BadInput, MissingExtra, NotFound])
def test_errors_come_back_from_other_processes_as_they_were(kind):
    error = kind("the file is empty", fix="record it again")
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is kind
    assert (str(again), again.problem, again.fix) == (str(error), error.problem, error.fix)
