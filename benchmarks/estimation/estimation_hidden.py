"""Is the default filter honest in a current that nobody told it, and with bad input?

Every flight's current, heading, eddies and sensor noise are drawn when this runs, from a seed that
is drawn too unless one is given. The filter is the robot's own, as delivered for its water: its
settings hold a standard deviation of the current, never the current.
"""

import math
import secrets
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from autonomy.arrays import BoolArray, FloatArray
from autonomy.estimation.config import (
    MODEL_FILTER_PRESETS,
    EstimatorConfig,
    ModelFilterConfig,
    WaterMotionConfig,
    estimator_preset,
)
from autonomy.estimation.model_filter import ModelFilter
from autonomy.estimation.position import STD_95
from benchmarks.estimation.estimation_trial.consistency import normalized_error_squared
from benchmarks.estimation.estimation_trial.trial_flight import (
    PERIOD_S,
    Flight,
    SensorErrors,
    WaterMotion,
    dives,
    fly_trial,
)
from simulator.fleet import GRACE_1, MINI_1, RobotDefinition

FASTEST_M_S = {"tank": 0.03, "lake": 0.20}
"""Currents are drawn evenly up to here, in any direction."""
DIVE_S = {"tank": 100.0, "lake": 400.0}
DIVES = 6
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
        preset.model_copy(update={"current": WaterMotionConfig.model_validate(water.model_dump())}),
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


def drawn_flights(
    robot: RobotDefinition,
    seed: int,
    count: int,
    flown: Callable[[RobotDefinition, np.random.Generator], Judged],
) -> list[Judged]:
    """Draw flights and judge the filter on each."""
    return [flown(robot, np.random.default_rng([seed, robot.system_id, i])) for i in range(count)]


def in_steady_current(robot: RobotDefinition, rng: np.random.Generator) -> Judged:
    """Judge a flight in a current that lasts."""
    return judged(hidden_flight(robot, rng, drawn_current(robot, rng)), default_filter(robot))


def at_two_cm_s(robot: RobotDefinition, rng: np.random.Generator) -> Judged:
    """Judge a flight at 2 cm/s in any direction."""
    to = rng.uniform(-math.pi, math.pi)
    flight = hidden_flight(robot, rng, 0.02 * np.array([math.cos(to), math.sin(to)]))
    return judged(flight, default_filter(robot))


def with_prior(
    prior_m_s: float,
) -> Callable[[RobotDefinition, np.random.Generator], Judged]:
    """Return what judges a flight in a lasting current with another belief in its strength."""

    def flown(robot: RobotDefinition, rng: np.random.Generator) -> Judged:
        estimator = estimator_preset(robot.vehicle.key, robot.site.kind)
        told = estimator.model_copy(update={"steady_current_m_s": prior_m_s})
        flight = hidden_flight(robot, rng, drawn_current(robot, rng))
        return judged(flight, default_filter(robot, told))

    return flown


def with_bad_fixes(robot: RobotDefinition, rng: np.random.Generator) -> Judged:
    """Judge a flight of which one fix in twenty, alone, is 200 m off."""
    flight = hidden_flight(robot, rng, drawn_current(robot, rng))
    rows = np.flatnonzero(flight.has_fix)
    bad = rows[rng.random(len(rows)) < 0.05]
    to = rng.uniform(-math.pi, math.pi, len(bad))
    flight.fix_ne[bad] += FAR_M * np.column_stack([np.cos(to), np.sin(to)])
    return judged(flight, default_filter(robot))


def with_turned_compass(robot: RobotDefinition, rng: np.random.Generator) -> Judged:
    """Judge a flight with a compass that is 20 deg off to either side."""
    compass_rad = math.radians(20.0) * rng.choice([-1.0, 1.0])
    flight = hidden_flight(robot, rng, drawn_current(robot, rng), compass_rad)
    return judged(flight, default_filter(robot))


def in_a_tide(period_s: float) -> Callable[[RobotDefinition, np.random.Generator], Judged]:
    """Return what judges a flight in a current that runs to and fro with this period."""

    def flown(robot: RobotDefinition, rng: np.random.Generator) -> Judged:
        strength, phase = drawn_current(robot, rng), rng.uniform(-math.pi, math.pi)
        times = PERIOD_S * np.arange(round(DIVES * DIVE_S[robot.site.kind] / PERIOD_S))
        swing = np.cos(2.0 * math.pi * times / period_s + phase)
        return judged(hidden_flight(robot, rng, swing[:, None] * strength), default_filter(robot))

    return flown


def interval(values: Iterable[float]) -> tuple[float, float]:
    """Return a mean over flights and half of its 95 % interval."""
    array = np.array(list(values))
    return float(array.mean()), 1.96 * float(array.std(ddof=1)) / math.sqrt(len(array))


NEES_BAR = (1.5, 2.7)
HELD_BAR = (0.90, 0.99)
EARLY_BAR = 0.80
ERROR_BAR_M = 0.35
FLIGHTS = 24
CASES: dict[str, Callable[[RobotDefinition, np.random.Generator], Judged]] = {
    "a current prior of 0": with_prior(0.0),
    "a current prior of 2 m/s": with_prior(2.0),
    "one fix in 20 off by 200 m": with_bad_fixes,
    "a compass 20 deg off": with_turned_compass,
    "a tide of 12.4 h": in_a_tide(44712.0),
    "a tide of 40 min": in_a_tide(2400.0),
}
"""Bad input, by what it is."""


def measure(flights: int = FLIGHTS, seed: int | None = None) -> list[dict[str, Any]]:
    """Judge the default filter of both robots on flights drawn now."""
    drawn = secrets.randbits(32) if seed is None else seed
    rows: list[dict[str, Any]] = []
    for robot in (MINI_1, GRACE_1):
        water = robot.site.kind
        flown = drawn_flights(robot, drawn, flights, in_steady_current)
        where = f"{water}, steady to {100 * FASTEST_M_S[water]:g} cm/s untold, seed {drawn}"
        nees, nees_half = interval(one.nees(one.late) for one in flown)
        held, held_half = interval(one.held(one.late) for one in flown)
        early, early_half = interval(one.held(~one.late) for one in flown)
        rows += [
            row(f"Default filter, {where}: NEES +- {nees_half:.2f}", nees, "",
                f"{NEES_BAR[0]} to {NEES_BAR[1]}",
                within(nees, nees_half, *NEES_BAR)),
            row(f"Default filter, {where}: 95 % circle holds +- {100 * held_half:.1f}",
                100.0 * held, "%", "90 to 99", within(held, held_half, *HELD_BAR)),
            row(f"Default filter, {where}: before the third fix +- {100 * early_half:.1f}",
                100.0 * early, "%", 100.0 * EARLY_BAR, early + early_half >= EARLY_BAR),
        ]  # fmt: skip
        for name, case in CASES.items():
            rows += bad_rows(f"{water}, {name}", drawn_flights(robot, drawn, flights // 3, case))
    errors = [
        float(np.mean(one.error_m[one.late] ** 2))
        for one in drawn_flights(MINI_1, drawn, flights, at_two_cm_s)
    ]
    error_m = math.sqrt(float(np.mean(errors)))
    rows.append(row("Default filter, tank at 2 cm/s untold: position under water", error_m, "m RMS",
                    ERROR_BAR_M, error_m <= ERROR_BAR_M))  # fmt: skip
    return rows


def bad_rows(where: str, flown: list[Judged]) -> list[dict[str, Any]]:
    """Say how the filter fared with bad input."""
    held, half = interval(one.held(one.late) for one in flown)
    nees, _ = interval(one.nees(one.late) for one in flown)
    doubt = float(np.mean([one.doubt for one in flown]))
    refused = sum(one.refused for one in flown)
    name = f"Default filter, {where}: 95 % circle holds +- {100 * half:.1f}"
    return [
        row(f"{name}; NEES {nees:.2f}, doubt {doubt:.2f}, {refused} fixes refused",
            100.0 * held, "%")
    ]  # fmt: skip


def within(mean: float, half: float, low: float, high: float) -> bool:
    """Tell whether a mean's 95 % interval reaches into a bar."""
    return mean + half >= low and mean - half <= high


def row(
    name: str,
    value: float,
    unit: str,
    bar: float | str | None = None,
    met: bool | None = None,
) -> dict[str, Any]:
    return {
        "area": "estimation_hidden", "name": name, "value": value, "unit": unit, "bar": bar,
        "met": met,
    }  # fmt: skip


if __name__ == "__main__":
    for line in measure():
        print(line)
