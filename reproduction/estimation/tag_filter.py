"""Pose in the tank: AprilTags seen by overhead cameras, with depth, compass and gyro.

Constant velocity and constant turn rate driven by white acceleration (thesis sections 3.4.3 and
5.5.1). All noise is diagonal, so north, east, down and heading are four filters of two states.
The simulated tank's fixes are positions already, so no simulated robot runs this filter: it is for
a tank whose cameras hand on what they see.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.estimation.config import TagFilterConfig
from autonomy.estimation.kernel import measure_tag, step_tags, turn


@dataclass(frozen=True, slots=True)
class TagPose:
    """The robot's pose as one detected tag shows it."""

    position_ned: tuple[float, float, float]
    """In the tank's frame, m."""
    heading_rad: float

    @property
    def packed(self) -> FloatArray:
        """Position and heading, shape ``(4,)``."""
        return np.array([*self.position_ned, self.heading_rad])


class TagFilter:
    """Kalman filter of position, heading and their rates.

    A pose far from the prediction is refused; after ``outlier.patience`` refusals in a row the
    filter takes itself for lost, widens its covariance and believes the next one. A detection
    that repeats the last one to the last digit brings nothing new and is left out.

    Args:
        config: Noise that the filter assumes.
        pose: First pose.
        pose_std_m: How well its position is known, per axis.
        heading_std_rad: How well its heading is known.

    Raises:
        ValueError: If a number is not finite.
    """

    def __init__(
        self,
        config: TagFilterConfig,
        pose: TagPose,
        pose_std_m: float,
        heading_std_rad: float,
    ) -> None:
        if not np.isfinite([*pose.packed, pose_std_m, heading_std_rad]).all():
            raise ValueError("the tag filter must begin at a finite pose")
        self._config = config
        self._density, self._variance, self._tag_variance = tag_noise(config)
        self._axes = np.zeros((4, 5))
        self._axes[:, 0] = pose.packed
        self._axes[3, 0] = turn(pose.heading_rad)
        self._axes[:3, 2] = pose_std_m**2
        self._axes[3, 2] = heading_std_rad**2
        self._axes[:, 4] = [0.1**2, 0.1**2, 0.1**2, 0.1**2]
        self._refused = np.zeros(2)
        self._newest: TagPose | None = None
        self._since_tag_s = 0.0

    @property
    def position_ned(self) -> tuple[float, float, float]:
        """Estimated position, m."""
        north, east, down, _ = self._axes[:, 0].tolist()
        return (north, east, down)

    @property
    def heading_rad(self) -> float:
        """Estimated heading, in ``[-pi, pi)``."""
        return float(self._axes[3, 0])

    @property
    def velocity_ned(self) -> tuple[float, float, float]:
        """Estimated velocity over ground, m/s."""
        north, east, down, _ = self._axes[:, 1].tolist()
        return (north, east, down)

    @property
    def turn_rate_rad_s(self) -> float:
        """Estimated rate of the heading."""
        return float(self._axes[3, 1])

    @property
    def covariance(self) -> FloatArray:
        """Covariance of position and heading and then of their rates, shape ``(8, 8)``."""
        a, b, d = (np.diag(self._axes[:, k]) for k in (2, 3, 4))
        return np.block([[a, b], [b, d]])

    @property
    def position_std_m(self) -> float:
        """Standard deviation of the horizontal position along its worst direction, m."""
        return math.sqrt(max(self._axes[:2, 2].tolist()))

    @property
    def since_tag_s(self) -> float:
        """Time since a tag was last believed; dead reckoning takes over when it grows."""
        return self._since_tag_s

    @property
    def refused_poses(self) -> int:
        """How many poses were refused as outliers so far."""
        return int(self._refused[1])

    def step(
        self,
        dt_s: float,
        *,
        depth_m: float,
        attitude_rad: Sequence[float] | FloatArray,
        gyro_rad_s: Sequence[float] | FloatArray,
        poses: Sequence[TagPose] = (),
    ) -> None:
        """Let ``dt_s`` pass, then take in what was measured at its end.

        Args:
            dt_s: Time since the last step, s; positive.
            depth_m: From the pressure sensor.
            attitude_rad: Measured roll and pitch, and the heading by the compass.
            gyro_rad_s: Body rates.
            poses: What the cameras see of the robot's tags; empty while none is visible.

        Raises:
            ValueError: If ``dt_s`` is not positive or a measurement is not finite.
        """
        attitude, gyro = (np.array(three, dtype=np.float64) for three in (attitude_rad, gyro_rad_s))
        measured = [dt_s, depth_m, *attitude, *gyro]
        seen = [pose.packed for pose in poses]
        if not (dt_s > 0.0 and np.isfinite(measured).all() and np.isfinite(seen).all()):
            raise ValueError("the tag filter needs dt > 0 and finite measurements")
        step_tags(
            self._axes,
            dt_s,
            depth_m,
            attitude,
            gyro,
            self._density,
            self._variance,
        )
        self._since_tag_s += dt_s
        outlier = self._config.outlier
        for pose, packed in zip(poses, seen, strict=True):
            if pose == self._newest:
                continue
            self._newest = pose
            if measure_tag(
                self._axes,
                packed,
                self._tag_variance,
                outlier.limit,
                outlier.patience,
                self._refused,
            ):
                self._since_tag_s = 0.0


def tag_noise(config: TagFilterConfig) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return acceleration densities ``(4,)``, variances ``(3,)`` and a tag's variances ``(4,)``."""
    across = config.acceleration_density
    return (
        np.array([across, across, config.vertical_acceleration_density, config.turn_density]),
        np.array([config.depth_std_m, config.gyro_std_rad_s, config.compass_std_rad]) ** 2,
        np.array([config.tag_std_m] * 3 + [config.tag_heading_std_rad]) ** 2,
    )
