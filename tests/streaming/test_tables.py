import csv

import numpy as np
import pytest

from evimo.recordings.estimate import Estimate, MovingObject
from evimo.streaming.tables import Tables

SHAPE = (3, 4)


def estimate_with(*objects: MovingObject, t_us: int) -> Estimate:
    maps = np.zeros(SHAPE, np.float32)
    return Estimate(
        t_us=t_us,
        start_us=t_us - 12_500,
        stop_us=t_us + 12_500,
        moving_probability=maps,
        ids=np.zeros(SHAPE, np.uint8),
        rel_depth=maps,
        flow=np.zeros((2, *SHAPE), np.float32),
        confidence=maps,
        valid=np.ones(SHAPE, np.bool_),
        ego=np.array([0.1, -0.2, 1 / 3, 1e-7, 0, 12345678.0]),
        objects=objects,
    )


def test_what_is_written_is_read_back(tmp_path):
    ball = MovingObject(7, (1, 2, 3, 4), 9, (2.25, 3.5), 0.75, np.array([1.5, 0, -2]))
    car = MovingObject(1, (0, 0, 9, 9), 50, (4.5, 4.5), 1.25, np.zeros(3))
    tables = Tables(tmp_path / "ego.csv", tmp_path / "objects.csv")
    tables.write(estimate_with(t_us=1_667_000_000_012_500))
    tables.write(estimate_with(ball, car, t_us=1_667_000_000_037_500))
    tables.close()
    with (tmp_path / "ego.csv").open(newline="") as file:
        ego = list(csv.DictReader(file))
    assert [int(row["t_us"]) for row in ego] == [1_667_000_000_012_500, 1_667_000_000_037_500]
    assert list(ego[0]) == ["t_us", "rel_vx", "rel_vy", "rel_vz", "wx", "wy", "wz"]
    numbers = [float(ego[1][name]) for name in list(ego[0])[1:]]
    assert numbers == pytest.approx([0.1, -0.2, 1 / 3, 1e-7, 0, 12345678], rel=1e-5)
    with (tmp_path / "objects.csv").open(newline="") as file:
        objects = list(csv.DictReader(file))
    assert ",".join(objects[0]) == (
        "t_us,object,x0,y0,x1,y1,area_px,centroid_x,centroid_y,rel_distance,rel_vx,rel_vy,rel_vz"
    )
    assert [row["object"] for row in objects] == ["7", "1"]
    assert [float(objects[0][name]) for name in list(objects[0])[2:]] == [1, 2, 3, 4, 9, 2.25, 3.5, 0.75, 1.5, 0, -2]


def test_no_slices_leave_headers(tmp_path):
    Tables(tmp_path / "ego.csv", tmp_path / "objects.csv").close()
    assert (tmp_path / "ego.csv").read_text() == "t_us,rel_vx,rel_vy,rel_vz,wx,wy,wz\n"
