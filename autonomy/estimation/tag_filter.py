"""Pose in the tank: AprilTags seen by overhead cameras, with depth, compass and gyro.

Constant velocity and constant turn rate driven by white acceleration (thesis sections 3.4.3 and
5.5.1). All noise is diagonal, so north, east, down and heading are four filters of two states. A
pose far from the prediction is refused; after ``outlier.patience`` refusals in a row the filter
takes itself for lost, widens its covariance and believes the next one.
"""

import math
from collections.abc import Sequence

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import kernel
from autonomy.configuration import Configuration, quantity
from autonomy.estimation.config import OutlierConfig
from autonomy.estimation.kernel import (
    LOST,
    REFUSED,
    heading_rate,
    judge,
    measure_rate,
    measure_value,
    predict_axis,
    turn,
)


class TagFilterConfig(Configuration):
    """Noise of the filter that fuses AprilTag poses, depth, compass and gyro."""

    tag_std_m: float = quantity(0.03, "m", title="Tag position noise", gt=0.0, le=5.0)
    """Of one tag's position, per axis."""
    tag_heading_std_rad: float = quantity(
        0.05, "rad", title="Tag heading noise", gt=0.0, le=3.0, display_unit="deg"
    )
    """Of the heading that one tag shows."""
    depth_std_m: float = quantity(0.003, "m", title="Depth noise", gt=0.0, le=5.0)
    """Of one depth measurement."""
    compass_std_rad: float = quantity(
        math.radians(2.0), "rad", title="Compass noise", gt=0.0, le=3.0, display_unit="deg"
    )
    """Of one heading by the compass."""
    gyro_std_rad_s: float = quantity(
        0.005, "rad/s", title="Gyro noise", gt=0.0, le=1.0, advanced=True
    )
    """Of one turn rate."""
    acceleration_density: float = quantity(
        4.5e-5, "m^2/s^3", title="Acceleration noise", gt=0.0, le=1.0, advanced=True
    )
    """Spectral density of the horizontal acceleration: eddies, drift^2 over their squared
    correlation time; the robot changes its own speed more slowly."""
    vertical_acceleration_density: float = quantity(
        6e-5, "m^2/s^3", title="Vertical acceleration noise", gt=0.0, le=1.0, advanced=True
    )
    """Spectral density of the vertical acceleration: from 4 cm/s down to 4 cm/s up, and to rest at
    the surface, within a hundred seconds."""
    turn_density: float = quantity(
        1e-5, "rad^2/s^3", title="Turn acceleration noise", gt=0.0, le=1.0, advanced=True
    )
    """Spectral density of the angular acceleration about the vertical."""
    outlier: OutlierConfig = quantity(OutlierConfig(), title="Outliers", advanced=True)
    """When a tag's pose is refused."""


@kernel
def measure_tag(
    axes: FloatArray,
    pose: FloatArray,
    variance: FloatArray,
    limit: float,
    patience: int,
    refused: FloatArray,
) -> bool:
    """Take the pose that one tag shows into the four axes; tell whether it was believed.

    Args:
        axes: North, east, down and heading, shape ``(4, 5)``.
        pose: Position NED m and heading rad, shape ``(4,)``.
        variance: Of each, shape ``(4,)``.
        limit: As in ``judge``.
        patience: As in ``judge``.
        refused: As in ``judge``.
    """
    innovation = pose - axes[:, 0]
    innovation[3] = turn(innovation[3])
    distance = 0.0
    for i in range(4):
        distance += innovation[i] ** 2 / (axes[i, 2] + variance[i])
    verdict = judge(distance, limit, patience, refused)
    if verdict == REFUSED:
        return False
    for i in range(4):
        if verdict == LOST:
            axes[i, 2] += innovation[i] ** 2
        measure_value(axes[i], innovation[i], variance[i])
    axes[3, 0] = turn(axes[3, 0])
    return True


@kernel
def step_tags(
    axes: FloatArray,
    dt_s: float,
    depth_m: float,
    attitude: FloatArray,
    gyro: FloatArray,
    density: FloatArray,
    variance: FloatArray,
) -> None:
    """Advance the four axes of the tag filter by ``dt_s``, with what needs no tag.

    A gyro turns the heading the faster, and the noisier, the more the nose points up or down.

    Args:
        axes: North, east, down and heading, shape ``(4, 5)``.
        dt_s: Time since the last step, s.
        depth_m: Measured depth.
        attitude: Measured roll and pitch, and the heading by the compass, rad.
        gyro: Body rates, rad/s.
        density: Of the white acceleration per axis, shape ``(4,)``.
        variance: Of depth, gyro and compass, shape ``(3,)``.
    """
    for i in range(4):
        predict_axis(axes[i], dt_s, density[i])
    measure_value(axes[2], depth_m - axes[2, 0], variance[0])
    across = max(math.cos(attitude[1]), 0.1)
    rate = heading_rate(attitude, gyro)
    measure_rate(axes[3], rate - axes[3, 1], variance[1] / across**2)
    measure_value(axes[3], turn(attitude[2] - axes[3, 0]), variance[2])
    axes[3, 0] = turn(axes[3, 0])


def tag_noise(config: TagFilterConfig) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return acceleration densities ``(4,)``, variances ``(3,)`` and a tag's variances ``(4,)``."""
    across = config.acceleration_density
    return (
        np.array([across, across, config.vertical_acceleration_density, config.turn_density]),
        np.array([config.depth_std_m, config.gyro_std_rad_s, config.compass_std_rad]) ** 2,
        np.array([config.tag_std_m] * 3 + [config.tag_heading_std_rad]) ** 2,
    )


_UNTOLD = 1e6
"""Variance, m^2 or rad^2, of what a pose does not tell or is not asked."""


class TagFilter:
    """Follows a robot by the poses that cameras tell of it, and by depth, compass and gyro.

    It knows nothing of how the robot swims: without poses it goes on as it went. Its depth is the
    pressure sensor's alone: cameras use what a robot says of its depth to find it.

    Args:
        config: Noise of sensors and motion; that of a pose comes with the pose.
        position_ned: First position, m.
        position_std_m: How well north and east are known.
        heading_rad: First heading.
    """

    def __init__(
        self,
        config: TagFilterConfig,
        position_ned: Sequence[float],
        position_std_m: float,
        heading_rad: float,
    ) -> None:
        self._density, self._variance, _ = tag_noise(config)
        self._outlier = config.outlier
        self._refused = np.zeros(2)
        self._axes = np.zeros((4, 5))
        self._axes[:, 0] = (*position_ned, heading_rad)
        first_std = (position_std_m, position_std_m, config.depth_std_m, config.compass_std_rad)
        self._axes[:, 2] = np.square(first_std)
        self._axes[:, 4] = 0.1**2

    @property
    def position_ned(self) -> tuple[float, float, float]:
        """Estimated position, m."""
        north, east, down, _ = self._axes[:, 0].tolist()
        return north, east, down

    @property
    def position_std_m(self) -> float:
        """Standard deviation of the horizontal position along its worst direction, m."""
        return math.sqrt(max(self._axes[:2, 2].tolist()))

    @property
    def heading_rad(self) -> float:
        """Estimated heading, in ``[-pi, pi)``."""
        return float(self._axes[3, 0])

    @property
    def refused(self) -> int:
        """How many poses were refused as outliers so far."""
        return int(self._refused[1])

    def step(
        self, dt_s: float, depth_m: float, attitude_rad: FloatArray, gyro_rad_s: FloatArray
    ) -> None:
        """Let ``dt_s`` pass, then take in depth, compass and gyro.

        Args:
            dt_s: Time since the last step, s.
            depth_m: Measured depth.
            attitude_rad: Measured roll and pitch, and the heading by the compass, shape ``(3,)``.
            gyro_rad_s: Body rates, shape ``(3,)``.
        """
        step_tags(
            self._axes, dt_s, depth_m, attitude_rad, gyro_rad_s, self._density, self._variance
        )

    def take_pose(
        self,
        position_ne_m: tuple[float, float],
        heading_rad: float | None,
        variances: tuple[float, float],
        *,
        least_m2: float,
    ) -> tuple[float, float] | None:
        """Take in a pose, after ``step``.

        Args:
            position_ne_m: Where the robot is now by the pose, north and east.
            heading_rad: Its heading now; None where the pose tells none.
            variances: Of north and east each, m^2, and of the heading, rad^2.
            least_m2: Neither north nor east becomes surer by it than this.

        Returns:
            How far it moved the position north and east, m; None where it was refused.
        """
        horizontal, turned = variances
        if heading_rad is None:
            heading_rad, turned = self.heading_rad, _UNTOLD
        before = self._axes[:2, 0].copy()
        least = np.minimum(self._axes[:2, 2], least_m2)
        is_believed = measure_tag(
            self._axes,
            np.array([*position_ne_m, self._axes[2, 0], heading_rad]),
            np.array([horizontal, horizontal, _UNTOLD, turned]),
            self._outlier.limit,
            self._outlier.patience,
            self._refused,
        )
        if not is_believed:
            return None
        self._axes[:2, 2] = np.maximum(self._axes[:2, 2], least)
        north, east = (self._axes[:2, 0] - before).tolist()
        return north, east


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    four, three, density = np.ones(4), np.zeros(3), np.ones(4)
    measure_tag(np.ones((4, 5)), four, four, 20.0, 10, np.zeros(2))
    step_tags(np.ones((4, 5)), 0.1, 0.0, three, three, density, np.ones(3))
