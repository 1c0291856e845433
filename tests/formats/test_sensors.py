from pathlib import Path

import numpy as np
import pytest

from evimo.errors import BadFile, BadInput, EvimoWarning
from evimo.formats.sensors import KNOWN_SENSORS, assumed_sensor, sensor_size, whole_pixels


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


NUMBERS = ("i1", "i2", "i4", "i8", ">i2", ">i8", "f2", ">f2", "f4", "f8", ">f4", "g")


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", NUMBERS)
@pytest.mark.parametrize("before", [[], [-1], [-100]])
def test_pixels_of_every_type_are_whole_or_outside_every_sensor(kind, before):
    stored = np.array([*before, 0, 1, 127], kind)
    for values in stored, stored[::-1], np.ma.masked_array(stored, stored == 1), np.repeat(stored, 3)[::3]:
        assert whole_pixels(values).tolist() == [
            65535 if value < 0 else int(value) for value in np.asarray(values).tolist()
        ]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", [kind for kind in NUMBERS if "f" in kind or kind == "g"])
def test_pixels_that_are_no_numbers_are_outside_every_sensor(kind):
    values = np.array([np.nan, np.inf, -np.inf, -0.4, 0.6, 2.5, 7], kind)
    assert whole_pixels(values).tolist() == [65535, 65535, 65535, 0, 1, 2, 7]
    assert whole_pixels(values[3:]).tolist() == [0, 1, 2, 7]


def test_pixels_of_no_events_and_of_true_and_false():
    assert whole_pixels(np.zeros(0)).tolist() == []
    assert whole_pixels(np.array([True, False])).tolist() == [1, 0]
