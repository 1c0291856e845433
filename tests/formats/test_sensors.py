from pathlib import Path

import pytest

from evimo.errors import BadFile, BadInput, EvimoWarning
from evimo.formats.sensors import KNOWN_SENSORS, assumed_sensor, sensor_size


def test_convention_sensor_is_written_width_first_and_kept_height_first():
    assert sensor_size("346x260") == (260, 346) == sensor_size(" 346 X 260 ") == sensor_size("346×260")


@pytest.mark.parametrize("written", ["346", "346x", "x260", "346*260", "-346x260", "0x260", "wide"])
def test_what_is_no_size_is_said(written):
    with pytest.raises(BadInput, match="as in --sensor 346x260"):
        sensor_size(written)


@pytest.mark.parametrize("extent, sensor", [((1, 1), (128, 128)), ((181, 10), (240, 304)), ((260, 346), (260, 346))])
def test_the_smallest_sensor_that_holds_all_is_taken_and_said(extent, sensor):
    with pytest.warns(EvimoWarning, match=f"taken as {sensor[1]}x{sensor[0]}.*--sensor"):
        assert assumed_sensor(Path("x.txt"), extent) == sensor


def test_known_sensors_are_ordered_by_area():
    areas = [height * width for height, width in KNOWN_SENSORS]
    assert areas == sorted(areas)


def test_beyond_all_sensors_the_user_is_asked():
    with pytest.raises(BadFile, match="--sensor"):
        assumed_sensor(Path("x.txt"), (721, 10))
