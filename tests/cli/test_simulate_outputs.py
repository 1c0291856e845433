"""What `evimo simulate` says of places it cannot write to and of lengths that are none."""

import pytest

from evimo.cli.simulate import simulate
from evimo.errors import BadInput


@pytest.mark.parametrize("replica", [True, False])
def test_an_output_that_is_a_file_is_said(tmp_path, replica):
    (tmp_path / "taken").write_text("")
    with pytest.raises(BadInput, match=r"cannot write .*: File exists"):
        simulate(minutes=0.05, out=tmp_path / "taken", size="44x33", replica=replica)


@pytest.mark.parametrize(
    "how", [{"minutes": float("nan")}, {"minutes": float("inf")}, {"minutes": 1.0, "seconds": float("nan")}]
)
def test_no_number_is_no_length(tmp_path, how):
    with pytest.raises(BadInput):
        simulate(out=tmp_path / "out", size="44x33", **how)
    assert not (tmp_path / "out").exists()


def test_a_replica_of_no_length_is_refused(tmp_path):
    with pytest.raises(BadInput):
        simulate(minutes=float("nan"), out=tmp_path, size="44x33", replica=True)


def test_an_empty_set_is_refused(tmp_path):
    with pytest.raises(BadInput, match="no set"):
        simulate(set="", minutes=1.0, out=tmp_path)
