"""What an inertial measurement unit at the camera says: rotation and specific force, with noise."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

F4 = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Imu:
    """M samples of a gyroscope and an accelerometer at the camera's optical centre, in camera axes.

    t_us:       (M,) int64, µs in the events' clock.
    gyro:       (M, 3) angular velocity, rad/s.
    accel:      (M, 3) specific force, m/s²: acceleration less gravity. A camera at rest measures 9.81 *upwards*, which
                is (0, -9.81, 0) where it looks at the horizon.
    gyro_bias, accel_bias: (M, 3) how much of them is bias: truth.
    """

    t_us: NDArray[np.int64]
    gyro: F4
    accel: F4
    gyro_bias: F4
    accel_bias: F4

    def __len__(self) -> int:
        return len(self.t_us)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """The fields by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


IMU_ARRAYS = tuple(field.name for field in fields(Imu))
