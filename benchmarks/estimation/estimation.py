"""Are the estimators' covariances honest, and how well does each know the position?

Every flight is 600 s of true dynamics with the sensors and the current of a simulated robot. What
uses the vehicle's model is judged with the right one and with one of which every coefficient of
force and moment is 10 % too large or too small. An estimator must not be overconfident, by bounds
from the spread between the flights (``estimation_trial.consistency``), and its doubt has an end.
"""

import math
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeVar

import numpy as np

from autonomy.estimation.config import (
    ESTIMATOR_PRESETS,
    MODEL_FILTER_PRESETS,
    WaterMotionConfig,
)
from autonomy.estimation.tag_filter import TagFilterConfig
from autonomy.vehicle.config import Vehicle
from benchmarks.estimation import observer_table
from benchmarks.estimation.estimation_trial import trial_flight_kernel
from benchmarks.estimation.estimation_trial.consistency import consistency, normalized_error_squared
from benchmarks.estimation.estimation_trial.dead_reckoning import DEAD_RECKONING_PRESETS
from benchmarks.estimation.estimation_trial.follow import (
    Track,
    by_dead_reckoning,
    by_model_filter,
    by_position_filter,
    by_tag_filter,
    observed_velocity,
    observer_covariance,
)
from benchmarks.estimation.estimation_trial.trial_flight import (
    Flight,
    SensorErrors,
    TagErrors,
    WaterMotion,
    dives,
    fly_trial,
    sightings,
)
from simulator.fleet import GRACE_1, MINI_1, RobotDefinition

RUNS = 24
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
DOUBT_BAR = 1.5
"""Standard deviations may be stated this much larger than the errors are."""
MODEL_ERROR = 0.1
RIGHT, WRONG = "right model", f"{100 * MODEL_ERROR:g} % wrong model"
VELOCITY_DOUBT_BAR = {RIGHT: 3.0, WRONG: 2.0}
"""The same of a velocity, whose filter allows for a model that is wrong by more than this one."""
COEFFICIENTS = (
    *("drag_0", "drag_alpha", "drag_delta", "side_beta", "side_delta", "lift_0", "lift_alpha"),
    *("roll_beta_m", "roll_damping_m_s", "pitch_0_m", "pitch_alpha_m", "pitch_damping_m_s"),
    *("yaw_beta_m", "yaw_damping_m_s", "yaw_delta_m"),
)

T = TypeVar("T")


@dataclass(frozen=True)
class Modelled:
    """What the estimators that use a model made of one flight, once a second."""

    squares: dict[str, np.ndarray]
    model_filter_m: np.ndarray
    velocity_m_s: dict[str, np.ndarray]
    """Error of the velocity's amount."""


@dataclass(frozen=True)
class Outcome:
    """What every estimator made of one flight in a steady current, once a second."""

    reckoned: np.ndarray
    dead_reckoning_m: np.ndarray
    by_model: dict[str, Modelled]
    """With the right model and with a wrong one."""
    under_water: np.ndarray


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
    """Fly a trial of a simulated robot."""
    rng = np.random.default_rng([seed, robot.system_id])
    water = WaterMotion(robot.drift_m_sqrt_s, robot.current_correlation_s, steady_m_s)
    command = dives(robot.vehicle, DURATION_S, dive_s, rng)
    return fly_trial(robot.vehicle, sensor_errors(robot), water, command, rng)


def wrong_model(vehicle: Vehicle, seed: int, error: float = MODEL_ERROR) -> Vehicle:
    """Return a model of which each coefficient is too large or too small by this share."""
    signs = np.random.default_rng([seed, 3]).choice([-1.0, 1.0], len(COEFFICIENTS))
    right = vehicle.parameters
    changed = {
        name: getattr(right, name) * (1.0 + error * sign)
        for name, sign in zip(COEFFICIENTS, signs.tolist(), strict=True)
    }
    return replace(vehicle, parameters=right.model_copy(update=changed))


def position_filter_squares(robot: RobotDefinition, seed: int) -> np.ndarray:
    """Judge the position filter in eddies alone, for it knows of no steady current."""
    key = robot.vehicle.key
    flown = flight(robot, seed, 0.0, DIVE_S[key])
    estimator = ESTIMATOR_PRESETS[key]
    _, ned = observed_velocity(flown, robot.vehicle, estimator)
    return squares(by_position_filter(flown, ned, estimator))


def dive_outcome(robot: RobotDefinition, seed: int) -> Outcome:
    """Fly one seed and follow it with every estimator that needs no tags."""
    key = robot.vehicle.key
    steady_m_s = STEADY_M_S[key]
    flown = flight(robot, seed, steady_m_s, DIVE_S[key])
    water = water_of(robot, steady_m_s)
    reckoning = DEAD_RECKONING_PRESETS[key].model_copy(update={"current": water})
    _, ned = observed_velocity(flown, robot.vehicle, ESTIMATOR_PRESETS[key])
    reckoned = by_dead_reckoning(flown, ned, ESTIMATOR_PRESETS[key], reckoning)
    return Outcome(
        squares(reckoned),
        np.hypot(*reckoned.error[::EVERY].T),
        {
            RIGHT: modelled(robot, flown, robot.vehicle),
            WRONG: modelled(robot, flown, wrong_model(robot.vehicle, seed)),
        },
        flown.truth[::EVERY, 2] > 0.1,
    )


def modelled(robot: RobotDefinition, flown: Flight, model: Vehicle) -> Modelled:
    """Follow a flight with what uses a model, and judge the velocities too."""
    key = model.key
    estimator = ESTIMATOR_PRESETS[key]
    water = water_of(robot, STEADY_M_S[key])
    config = MODEL_FILTER_PRESETS[key].model_copy(update={"current": water})
    filtered = by_model_filter(flown, model, estimator, config)
    body, _ = observed_velocity(flown, model, estimator)
    doubt = observer_covariance(flown, body, model, estimator, config)
    observed = Track(flown.truth[:, 6:9] - body, doubt)
    tracks = {
        "Model filter's position": filtered.position,
        "Model filter's velocity": filtered.velocity,
        "Velocity observer": observed,
    }
    return Modelled(
        {name: squares(track) for name, track in tracks.items()},
        np.hypot(*filtered.position.error[::EVERY].T),
        {
            name: np.linalg.norm(tracks[name].error[::EVERY], axis=1)
            for name in ("Model filter's velocity", "Velocity observer")
        },
    )


def water_of(robot: RobotDefinition, steady_m_s: float) -> WaterMotionConfig:
    """Return how the water moves where a simulated robot works."""
    return WaterMotionConfig(
        eddy_correlation_s=robot.current_correlation_s, steady_std_m_s=steady_m_s
    )


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
    trial_flight_kernel.warm_up()
    begin = time.perf_counter()
    rows: list[dict[str, Any]] = []
    for robot in (MINI_1, GRACE_1):
        title = robot.vehicle.title
        still = in_parallel(partial(position_filter_squares, robot), range(runs))
        rows += judged(f"Position filter, {title}", np.array(still)[:, SETTLED:], 2)
        steady = in_parallel(partial(dive_outcome, robot), range(runs, 2 * runs))
        rows += dive_rows(f"{title}, steady {100 * STEADY_M_S[robot.vehicle.key]:g} cm/s", steady)
    tags = np.array(in_parallel(tag_squares, range(runs)))
    rows += judged("AprilTag filter, pose, Miniglider", tags[:, SETTLED:], 4)
    flights = (2 * 2 + 1) * runs
    rows.append(row(f"{flights} flights of 600 s and their filters", seconds_since(begin), "s"))
    return rows + observer_table.rows()


def seconds_since(begin: float) -> float:
    return time.perf_counter() - begin


def dive_rows(place: str, outcomes: list[Outcome]) -> list[dict[str, Any]]:
    """Judge the flights of one robot in a steady current."""
    under = np.array([outcome.under_water for outcome in outcomes])
    late = under.copy()
    late[:, : late.shape[1] // 2] = False
    # at the surface the robot rests, which noise of a motion does not know
    dive = under.all(axis=0)
    reckoned = np.array([outcome.reckoned for outcome in outcomes])[:, SETTLED:]
    rows = judged(f"Dead reckoning, {place}", reckoned, 2)
    reckoned_m = rms(np.array([outcome.dead_reckoning_m for outcome in outcomes])[late])
    rows.append(row(f"Position under water by dead reckoning, {place}", reckoned_m, "m RMS"))
    for kind in outcomes[0].by_model:
        of_kind = [outcome.by_model[kind] for outcome in outcomes]
        where = f"{kind}, {place}"
        for name in of_kind[0].squares:
            values = np.array([one.squares[name] for one in of_kind])
            if name.endswith("position"):
                rows += judged(f"{name}, {where}", values[:, SETTLED:], 2)
            else:
                bar = VELOCITY_DOUBT_BAR[kind]
                rows += judged(f"{name} under water, {where}", values[:, dive], 3, bar)
        for name in of_kind[0].velocity_m_s:
            errors = np.array([one.velocity_m_s[name] for one in of_kind])[:, dive]
            rows.append(row(f"{name} under water, {where}", 1e3 * rms(errors), "mm/s RMS"))
        modelled_m = rms(np.array([one.model_filter_m for one in of_kind])[late])
        share = modelled_m / reckoned_m
        rows += [
            row(f"Position under water by model filter, {where}", modelled_m, "m RMS"),
            row(f"Model filter over dead reckoning, {where}", share, "x", SHARE_BAR,
                share <= SHARE_BAR),
        ]  # fmt: skip
    return rows


def rms(values: np.ndarray) -> float:
    return math.sqrt(float(np.mean(np.square(values))))


def judged(
    name: str, values: np.ndarray, dimensions: int, doubt_bar: float = DOUBT_BAR
) -> list[dict[str, Any]]:
    """Judge normalized errors squared by the spread between the runs, and how much is doubted."""
    result = consistency(values, dimensions)
    bar = f"at most {result.high:.2f}"
    draws = f"{result.runs} runs of {result.draws:.1f} draws"
    return [
        row(f"{name}: NEES of {draws}", result.mean, "", bar, not result.is_overconfident),
        row(f"{name}: stated over true std", result.doubt, "x", doubt_bar,
            result.doubt <= doubt_bar),
        row(f"{name}: time inside the bounds", 100.0 * result.share_inside, "%"),
    ]  # fmt: skip


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
