"""Pose in the tank: AprilTags seen by overhead cameras, with depth, compass and gyro.

Constant velocity and constant turn rate driven by white acceleration (thesis sections 3.4.3 and
5.5.1). All noise is diagonal, so north, east, down and heading are four filters of two states. A
pose far from the prediction is refused; after ``outlier.patience`` refusals in a row the filter
takes itself for lost, widens its covariance and believes the next one. The simulated tank's fixes
are positions already, so no simulated robot runs this filter.
"""

import math

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
