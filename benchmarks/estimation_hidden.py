"""Is the default filter honest in a current that nobody told it, and with bad input?

Every flight's current, heading, eddies and sensor noise are drawn when this runs, from a seed that
is drawn too unless one is given. The filter is the robot's own, as delivered for its water: its
settings hold a standard deviation of the current, never the current.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from autonomy.arrays import BoolArray, FloatArray
from autonomy.estimation.config import (
    MODEL_FILTER_PRESETS,
    CurrentConfig,
    EstimatorConfig,
    ModelFilterConfig,
    estimator_preset,
)
from autonomy.estimation.model_filter import ModelFilter
from autonomy.estimation.position import STD_95
from benchmarks.estimation_trial.consistency import normalized_error_squared
from benchmarks.estimation_trial.trial_flight import (
    PERIOD_S,
    Flight,
    SensorErrors,
    WaterMotion,
    dives,
    fly_trial,
)
from simulator.fleet import RobotDefinition

FASTEST_M_S = {"tank": 0.03, "lake": 0.20}
"""Currents are drawn evenly up to here, in any direction."""
DIVE_S = {"tank": 100.0, "lake": 400.0}
DIVES = 8
EVERY = 10
"""Rows between two judged moments: once a second."""
THIRD_FIX = 3
_FIX_AWAY_S = 10.0
UNDER_WATER_M = 0.1
FAR_M = 200.0
"""How far off a bad fix is."""


@dataclass(frozen=True)
class Judged:
    """What the default filter made of one flight, at moments under water."""

    squared: FloatArray
    """Normalized error squared, shape ``(n,)``."""
    error_m: FloatArray
    fixes: FloatArray
    """How many fixes the robot had had by then: those at the start, and after each dive."""
    doubt: float
    """At the end."""
    refused: int

    @property
    def late(self) -> BoolArray:
        """From the third fix on."""
        return self.fixes >= THIRD_FIX

    def nees(self, when: BoolArray) -> float:
        """Return the mean of the normalized error squared at chosen moments."""
        return float(self.squared[when].mean())

    def held(self, when: BoolArray) -> float:
        """Return how often the 95 % circle held the truth at chosen moments."""
        return float((self.squared[when] <= STD_95**2).mean())


def sensor_errors(robot: RobotDefinition) -> SensorErrors:
    """Return the errors of a simulated robot's sensors."""
    s = robot.sensors
    return SensorErrors(
        depth_m=s.depth_std_m,
        tilt_rad=s.tilt_std_rad,
        heading_rad=s.heading_std_rad,
        gyro_rad_s=s.gyro_std_rad_s,
        buoyancy_bias_kg=s.buoyancy_bias_kg,
        buoyancy_kg=s.buoyancy_std_kg,
        mass_position_m=s.mass_position_std_m,
        tail_rad=s.tail_std_rad,
        fix_m=s.fix_std_m,
        fix_depth_m=s.fix_depth_m,
        fix_period_s=s.fix_period_s,
    )


def drawn_current(robot: RobotDefinition, rng: np.random.Generator) -> FloatArray:
    """Draw a steady current, shape ``(2,)``, m/s."""
    speed = FASTEST_M_S[robot.site.kind] * rng.random()
    to = rng.uniform(-math.pi, math.pi)
    return speed * np.array([math.cos(to), math.sin(to)])


def hidden_flight(
    robot: RobotDefinition,
    rng: np.random.Generator,
    steady_ne_m_s: FloatArray,
    compass_rad: float = 0.0,
) -> Flight:
    """Fly dives in a current of which the filter is not told."""
    dive_s = DIVE_S[robot.site.kind]
    errors = replace(sensor_errors(robot), compass_rad=compass_rad)
    water = WaterMotion(robot.drift_m_sqrt_s, robot.current_correlation_s)
    command = dives(robot.vehicle, DIVES * dive_s, dive_s, rng)
    return fly_trial(robot.vehicle, errors, water, command, rng, steady_ne_m_s)


def default_filter(robot: RobotDefinition, estimator: EstimatorConfig | None = None) -> ModelFilter:
    """Return the filter as a robot has it, at the origin."""
    estimator = estimator or estimator_preset(robot.vehicle.key, robot.site.kind)
    preset = MODEL_FILTER_PRESETS.get(robot.vehicle.key, ModelFilterConfig())
    water = preset.current.model_copy(
        update={
            "steady_std_m_s": estimator.steady_current_m_s,
            "steady_correlation_s": estimator.current_memory_s,
        }
    )
    return ModelFilter(
        estimator,
        preset.model_copy(update={"current": CurrentConfig.model_validate(water.model_dump())}),
        robot.vehicle,
        (0.0, 0.0, 0.0),
        estimator.fix_std_m,
        attitude_rad=(0.0, 0.0, 0.0),
        actuators=(0.0, 0.0, 0.0),
    )


def judged(flight: Flight, belief: ModelFilter) -> Judged:
    """Follow a flight with a filter and hold what it states against the truth."""
    squared: list[float] = []
    error: list[float] = []
    fixes: list[float] = []
    count, away_s = 1, 0.0
    for k in range(len(flight.command)):
        has_fix = bool(flight.has_fix[k])
        if has_fix and away_s > _FIX_AWAY_S:
            count += 1
        away_s = 0.0 if has_fix else away_s + PERIOD_S
        belief.step(
            PERIOD_S,
            flight.command[k],
            k * PERIOD_S,
            attitude_rad=flight.attitude[k],
            angular_velocity_rad_s=flight.gyro[k],
            actuators=flight.actuators[k],
            depth_m=float(flight.depth_m[k]),
            fix_ne=(float(flight.fix_ne[k, 0]), float(flight.fix_ne[k, 1])) if has_fix else None,
        )
        if k % EVERY == 0 and flight.truth[k, 2] > UNDER_WATER_M:
            off = flight.truth[k, :2] - belief.position_ned[:2]
            squared.append(float(normalized_error_squared(off, belief.position_covariance)))
            error.append(float(np.hypot(*off)))
            fixes.append(count)
    return Judged(
        np.array(squared), np.array(error), np.array(fixes), belief.doubt, belief.refused[0]
    )
