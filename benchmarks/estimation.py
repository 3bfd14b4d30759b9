"""Are the estimators' covariances honest, and how well does each know the position?

Every flight is 600 s of true dynamics with the sensors and the current of a simulated robot.
"""

import math
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np

from autonomy.estimation import rehearsal_kernel
from autonomy.estimation.config import (
    DEAD_RECKONING_PRESETS,
    ESTIMATOR_PRESETS,
    MODEL_FILTER_PRESETS,
    CurrentConfig,
    EstimatorConfig,
    TagFilterConfig,
)
from autonomy.estimation.consistency import consistency, normalized_error_squared
from autonomy.estimation.follow import (
    Track,
    by_dead_reckoning,
    by_model_filter,
    by_position_filter,
    by_tag_filter,
    observed_velocity,
)
from autonomy.estimation.rehearsal import (
    Flight,
    SensorErrors,
    TagErrors,
    WaterMotion,
    dives,
    rehearse,
    sightings,
)
from benchmarks import observer_table
from simulator.fleet import GRACE_1, MINI_1, RobotDefinition

RUNS = 100
DURATION_S = 600.0
WORKERS = 2
EVERY = 10
"""Rows between two judged moments: once a second."""
SETTLED = 10
"""Judged moments at the beginning that only show how the filters were started."""
STEADY_M_S = {"miniglider": 0.02, "grace3": 0.10}
DIVE_S = {"miniglider": 150.0, "grace3": 300.0}
TANK_DIVE_S = 75.0
SHARE_BAR = 0.5
"""The model filter's error is at most this part of dead reckoning's in a steady current."""

T = TypeVar("T")


@dataclass(frozen=True)
class Outcome:
    """What every estimator made of one flight, once a second."""

    squares: dict[str, np.ndarray]
    under_water: np.ndarray
    dead_reckoning_m: np.ndarray
    model_filter_m: np.ndarray
    velocity_error: np.ndarray


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


def flight(robot: RobotDefinition, seed: int, steady_m_s: float, dive_s: float) -> Flight:
    """Rehearse one flight of a simulated robot."""
    rng = np.random.default_rng([seed, robot.system_id])
    water = WaterMotion(robot.drift_m_sqrt_s, robot.current_correlation_s, steady_m_s)
    command = dives(robot.vehicle, DURATION_S, dive_s, rng)
    return rehearse(robot.vehicle, sensor_errors(robot), water, command, rng)


def dive_outcome(robot: RobotDefinition, steady_m_s: float, seed: int) -> Outcome:
    """Fly one seed and follow it with every estimator that needs no tags."""
    key = robot.vehicle.key
    flown = flight(robot, seed, steady_m_s, DIVE_S[key])
    water = CurrentConfig(eddy_correlation_s=robot.current_correlation_s, steady_std_m_s=steady_m_s)
    reckoning = DEAD_RECKONING_PRESETS[key].model_copy(update={"current": water})
    model = MODEL_FILTER_PRESETS[key].model_copy(update={"current": water})
    estimator = ESTIMATOR_PRESETS[key]
    body, ned = observed_velocity(flown, robot.vehicle, estimator)
    reckoned = by_dead_reckoning(flown, ned, estimator, reckoning)
    modelled = by_model_filter(flown, robot.vehicle, estimator, model)
    judged_tracks = {"Dead reckoning": reckoned, "Model filter": modelled.position}
    if steady_m_s == 0.0:  # the position filter knows of none
        physical = physical_position_filter(robot, estimator)
        judged_tracks |= {
            "Model filter's velocity under water": modelled.velocity,
            "Position filter as preset": by_position_filter(flown, ned, estimator),
            "Position filter that follows the eddies": by_position_filter(flown, ned, physical),
        }
    return Outcome(
        {name: squares(track) for name, track in judged_tracks.items()},
        flown.truth[::EVERY, 2] > 0.1,
        np.hypot(*reckoned.error[::EVERY].T),
        np.hypot(*modelled.position.error[::EVERY].T),
        (flown.truth[:, 6:9] - body)[::EVERY],
    )


def physical_position_filter(robot: RobotDefinition, estimator: EstimatorConfig) -> EstimatorConfig:
    """Let the velocity change as fast as the eddies change it, and the robot's dives as much."""
    density = 2.0 * (robot.drift_m_sqrt_s / robot.current_correlation_s) ** 2
    return estimator.model_copy(update={"acceleration_density": density})


def tag_squares(seed: int) -> np.ndarray:
    flown = flight(MINI_1, seed, 0.0, TANK_DIVE_S)
    poses, seen = sightings(flown, TagErrors(), np.random.default_rng([seed, 7]))
    return squares(by_tag_filter(flown, poses, seen, TagFilterConfig()))


def squares(track: Track) -> np.ndarray:
    return normalized_error_squared(track.error[::EVERY], track.covariance[::EVERY])


def in_parallel(call: Callable[[int], T], seeds: range) -> list[T]:
    with ThreadPoolExecutor(WORKERS) as pool:
        return list(pool.map(call, seeds))


def measure(runs: int = RUNS) -> list[dict[str, Any]]:
    """Judge every estimator over seeded flights of both robots."""
    rehearsal_kernel.warm_up()
    begin = time.perf_counter()
    rows: list[dict[str, Any]] = []
    for robot in (MINI_1, GRACE_1):
        steady_m_s = STEADY_M_S[robot.vehicle.key]
        still = in_parallel(partial(dive_outcome, robot, 0.0), range(runs))
        steady = in_parallel(partial(dive_outcome, robot, steady_m_s), range(runs, 2 * runs))
        title = robot.vehicle.title
        rows += dive_rows(title, still)
        rows += judged(f"Velocity observer, {title}", observer_squares(still, steady), 3)
        rows += dive_rows(f"{title}, steady current {100 * steady_m_s:g} cm/s", steady, SHARE_BAR)
    tags = np.array(in_parallel(tag_squares, range(runs)))
    rows += judged("AprilTag filter, pose, Miniglider", tags[:, SETTLED:], 4)
    flights = (4 + 1) * runs
    rows.append(row(f"{flights} flights of 600 s and their filters", seconds_since(begin), "s"))
    return rows + observer_table.rows()


def seconds_since(begin: float) -> float:
    return time.perf_counter() - begin


def dive_rows(
    place: str, outcomes: list[Outcome], share_bar: float | None = None
) -> list[dict[str, Any]]:
    """Judge the flights of one robot in one kind of water."""
    under = np.array([outcome.under_water for outcome in outcomes])
    rows: list[dict[str, Any]] = []
    for name in outcomes[0].squares:
        values = np.array([outcome.squares[name] for outcome in outcomes])
        if "velocity" in name:
            # at the surface the robot rests, which the filter's noise of motion does not know
            rows += judged(f"{name}, {place}", values[:, under.all(axis=0)], 3)
        else:
            rows += judged(f"{name}, {place}", values[:, SETTLED:], 2)
    return rows + position_rows(place, outcomes, under, share_bar)


def observer_squares(outcomes: list[Outcome], others: list[Outcome]) -> np.ndarray:
    """Normalize the observer's errors by the covariance that other flights had at that time.

    A current does not matter to a velocity through the water.
    """
    errors, other = (
        np.array([outcome.velocity_error for outcome in group])[:, SETTLED:]
        for group in (outcomes, others)
    )
    runs = len(other)
    moment = np.einsum("rti,rtj->tij", other, other) / runs
    unbiased = (runs - 4) / runs  # the inverse of an estimated covariance is too large by this
    return unbiased * normalized_error_squared(
        errors, np.broadcast_to(moment, (len(errors), *moment.shape))
    )


def position_rows(
    place: str, outcomes: list[Outcome], under: np.ndarray, share_bar: float | None
) -> list[dict[str, Any]]:
    """Compare dead reckoning with the model filter under water, in the second half."""
    late = under.copy()
    late[:, : late.shape[1] // 2] = False
    reckoned = rms(np.array([outcome.dead_reckoning_m for outcome in outcomes])[late])
    modelled = rms(np.array([outcome.model_filter_m for outcome in outcomes])[late])
    share = modelled / reckoned
    met = None if share_bar is None else share <= share_bar
    return [
        row(f"Position under water by dead reckoning, {place}", reckoned, "m RMS"),
        row(f"Position under water by model filter, {place}", modelled, "m RMS"),
        row(f"Model filter against dead reckoning, {place}", share, "x", share_bar, met),
    ]


def rms(values: np.ndarray) -> float:
    return math.sqrt(float(np.mean(np.square(values))))


def judged(name: str, values: np.ndarray, dimensions: int) -> list[dict[str, Any]]:
    result = consistency(values, dimensions)
    bar = f"{result.low:.2f} to {result.high:.2f}"
    return [
        row(f"{name}: NEES of {result.runs} runs", result.mean, "", bar, result.is_consistent),
        row(f"{name}: time inside the bounds", 100.0 * result.share_inside, "%"),
    ]


def row(
    name: str,
    value: float,
    unit: str,
    bar: float | str | None = None,
    met: bool | None = None,
) -> dict[str, Any]:
    return {
        "area": "estimation", "name": name, "value": value, "unit": unit, "bar": bar, "met": met
    }  # fmt: skip


if __name__ == "__main__":
    for line in measure():
        print(line)
