"""What the robot believes of itself: attitude, velocity and position from its own readings."""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.estimation.attitude import AttitudeFilter
from autonomy.estimation.config import EstimatorConfig
from autonomy.estimation.position_filter import PositionFilter
from autonomy.estimation.velocity_observer import VelocityObserver
from autonomy.site import Site
from autonomy.vehicle.config import Vehicle
from simulator.onboard.hardware import Readings, SetPoints

_FIX_HOLDS_S = 2.0


@dataclass(frozen=True, slots=True)
class Estimate:
    """The robot's belief at one moment."""

    position_ned: tuple[float, float, float]
    position_std_m: float
    """Of the horizontal position, larger axis."""
    velocity_ned: tuple[float, float, float]
    """Through the water, which is all that a robot without a fix knows."""
    state: FloatArray
    """The 12 states of the vehicle model as the controllers take them, shape ``(12,)``."""
    readings: Readings
    course_heading_rad: float
    """Heading averaged over one beat of the tail, whose wiggle no controller should fight."""
    has_fix: bool
    """Whether a fix arrived within the last two seconds."""

    @property
    def depth_m(self) -> float:
        """Depth below the surface, never negative."""
        return self.position_ned[2]

    @property
    def heading_rad(self) -> float:
        """Heading, in -pi..pi."""
        return float(self.state[5])

    @property
    def pitch_rad(self) -> float:
        """Pitch, nose up positive."""
        return float(self.state[4])


class Navigator:
    """Attitude filter, velocity observer and position filter, stepped together at 10 Hz.

    Args:
        config: Noise and gains that the filters assume.
        vehicle: Model of the velocity observer.
        site: Bounds the first position when there is no fix yet.
        readings: First readings.
        period_s: Time between two steps.
    """

    def __init__(
        self,
        config: EstimatorConfig,
        vehicle: Vehicle,
        site: Site,
        readings: Readings,
        period_s: float,
    ) -> None:
        water = site.water
        unknown_m = math.hypot(water.x_max_m - water.x_min_m, water.y_max_m - water.y_min_m) / 2.0
        centre = (0.5 * (water.x_min_m + water.x_max_m), 0.5 * (water.y_min_m + water.y_max_m))
        fix = readings.fix_ne_m
        self._config = config
        self._position = PositionFilter(
            config,
            (*(fix or centre), max(readings.depth_m, 0.0)),
            config.fix_std_m if fix else unknown_m,
        )
        self._observer = VelocityObserver(config, vehicle, readings.depth_m)
        self._attitude = AttitudeFilter(
            (readings.roll_rad, readings.pitch_rad, readings.heading_rad), readings.gyro_rad_s
        )
        self._headings: deque[float] = deque(
            maxlen=round(1.0 / (vehicle.swim.frequency_hz * period_s))
        )
        self._period_s = period_s
        self._since_fix_s = 0.0 if fix else math.inf

    def step(self, readings: Readings, command: SetPoints, time_s: float) -> Estimate:
        """Take in one set of readings.

        Args:
            readings: Sensors at the end of the step.
            command: Set points that were in force during the step.
            time_s: Time at the beginning of the step, on the clock of the tail's beat.
        """
        dt_s = self._period_s
        measured = (readings.roll_rad, readings.pitch_rad, readings.heading_rad)
        self._attitude.step(dt_s, measured, readings.gyro_rad_s)
        attitude, rates = self._attitude.attitude_rad, self._attitude.rates_rad_s
        net_buoyancy = readings.net_buoyancy_kg
        if readings.depth_m < self._config.surface_depth_m:
            # the air carries no robot: what would lift it out of the water does not accelerate it
            net_buoyancy = max(net_buoyancy, 0.0)
        self._observer.step(
            dt_s,
            np.array(
                [
                    net_buoyancy,
                    command.mass_position_m,
                    command.tail_rad,
                    command.tail_amplitude_rad,
                    command.tail_frequency_hz,
                ]
            ),
            time_s,
            attitude_rad=attitude,
            angular_velocity_rad_s=rates,
            actuators=(net_buoyancy, readings.mass_position_m, readings.tail_rad),
            depth_m=readings.depth_m,
        )
        velocity_ned = self._observer.velocity_ned
        self._position.step(dt_s, velocity_ned, readings.depth_m, readings.fix_ne_m)
        self._since_fix_s = 0.0 if readings.fix_ne_m else self._since_fix_s + dt_s
        north, east, down = self._position.position_ned
        position = (north, east, max(down, 0.0))
        state = np.concatenate([position, attitude, self._observer.velocity_body, rates])
        return Estimate(
            position_ned=position,
            position_std_m=self._position.position_std_m,
            velocity_ned=velocity_ned,
            state=state,
            readings=readings,
            course_heading_rad=self._mean_heading(),
            has_fix=self._since_fix_s < _FIX_HOLDS_S,
        )

    def _mean_heading(self) -> float:
        newest = float(self._attitude.attitude_rad[2])
        self._headings.append(newest)
        wiggle = sum(math.remainder(angle - newest, math.tau) for angle in self._headings)
        return math.remainder(newest + wiggle / len(self._headings), math.tau)
