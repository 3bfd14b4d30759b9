"""Worlds for maps, drawn at run time: a field, water that moves, a robot, and its survey.

Everything that the station is not told is drawn from the distributions stated here, so that no
setting can be tuned on the cases that judge it.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.estimation.config import EstimatorConfig
from autonomy.estimation.position import surface_covariance
from autonomy.estimation.smoother import Dive
from autonomy.field import synthetic
from autonomy.field.config import FieldConfig
from autonomy.field.samples import FieldSamples, joined
from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg.edge import (
    POINT_DOWN,
    POINT_EAST,
    POINT_NORTH,
    POINT_TIME,
    propose_edge,
    random_shape,
)
from autonomy.planner.search import search
from reproduction.adaptive.point_robot import Flight
from reproduction.adaptive.scenario import SCENARIOS, START_NE_M, Scenario, planner_config
from reproduction.adaptive.survey import NoPlanError, Survey, inside, planning_belief

NOISE = 0.05
"""Standard deviation of one measurement, in log counts."""
MANUAL_SAMPLES = 400
PRIOR_CURRENT_M_S = 0.01
"""What the tank's robots believe of a current before any fix."""
_FIX_PERIOD_S = 2.0
_RETURN_S = 10.0
_WAVES = 400

Family = Literal["lamps", "patches"]
Reckoning = Literal["model", "dead reckoning"]


@dataclass(frozen=True, slots=True)
class Water:
    """How the water moves, and what the robot is told of it."""

    name: str
    steady_m_s: float
    """Speed of a steady current, of which nobody is told."""
    walk_m_sqrt_s: tuple[float, float]
    """Between these the eddies' drift is drawn, evenly in its logarithm."""
    told_m_sqrt_s: float | None = None
    """Drift that the robot's filter assumes; the true one where it is none."""


WATERS = (
    Water("still", 0.0, (0.0, 0.0), 0.005),
    Water("drift as told", 0.0, (0.01, 0.03)),
    Water("1.5 cm/s untold", 0.015, (0.01, 0.03)),
    Water("3 cm/s untold", 0.03, (0.01, 0.03)),
)


@dataclass(frozen=True, slots=True)
class World:
    """One drawn case."""

    field: Callable[[FloatArray], FloatArray]
    """Log counts at points ``(n, 3)``, shape ``(n,)``."""
    walk_m_sqrt_s: float
    current_ne_m_s: FloatArray
    told_m_sqrt_s: float
    reckoning: Reckoning


def drawn_world(
    family: Family, water: Water, reckoning: Reckoning, rng: np.random.Generator
) -> World:
    """Draw a field of a family, a direction of the current, and how strong the eddies are."""
    low, high = water.walk_m_sqrt_s
    walk = low if low == high else math.exp(rng.uniform(math.log(low), math.log(high)))
    course = rng.uniform(0.0, 2.0 * math.pi)
    current = water.steady_m_s * np.array([math.cos(course), math.sin(course)])
    told = walk if water.told_m_sqrt_s is None else water.told_m_sqrt_s
    field = _lamps(rng) if family == "lamps" else _patches(rng)
    return World(field, walk, current, told, reckoning)


def _lamps(rng: np.random.Generator) -> Callable[[FloatArray], FloatArray]:
    """Two to four lamps in dim daylight, as the tank's own field has two."""
    count = int(rng.integers(2, 5))
    places = rng.uniform([0.2, 0.2, 0.1], [2.55, 1.17, 0.6], (count, 3))
    brightness = np.exp(rng.uniform(math.log(30.0), math.log(120.0), count))
    radius = rng.uniform(0.2, 0.4, count)

    def field(points: FloatArray) -> FloatArray:
        counts = 30.0 * np.exp(-1.2 * points[:, 2])
        for place, bright, blunt in zip(places, brightness, radius, strict=True):
            squared = np.sum(np.square(points - place), axis=1)
            counts += bright * np.exp(-1.1 * np.sqrt(squared)) / (squared + blunt**2)
        return np.log(np.minimum(counts, synthetic.LARGEST_COUNT))

    return field


def _patches(rng: np.random.Generator) -> Callable[[FloatArray], FloatArray]:
    """A Matern-3/2 field of 400 random waves: lengths of 0.8 to 2 m, deviation of 0.5 to 1.2."""
    lengths = np.exp(rng.uniform(math.log(0.8), math.log(2.0), 3))
    std = math.exp(rng.uniform(math.log(0.5), math.log(1.2)))
    # the spectrum of a Matern-3/2 kernel is Student's t with three degrees of freedom
    waves = rng.standard_normal((_WAVES, 3)) / np.sqrt(rng.chisquare(3, (_WAVES, 1)) / 3.0)
    waves /= lengths
    phase = rng.uniform(0.0, 2.0 * math.pi, _WAVES)
    height = std * math.sqrt(2.0 / _WAVES)

    def field(points: FloatArray) -> FloatArray:
        return 5.0 + height * np.cos(points @ waves.T + phase).sum(axis=1)

    return field


class _Filter:
    """Error and stated covariance of a robot's position, the same on each horizontal axis.

    Either filter allows for a current of the tank's prior; by ``model`` fixes tell it.
    """

    def __init__(self, told: EstimatorConfig, reckoning: Reckoning) -> None:
        self._told = told
        self._knows_current = reckoning == "model"
        self._axis = surface_covariance(told, _FIX_PERIOD_S)
        self._blind_s = 0.0
        self._spread = np.array([[self._axis.position, 0.0], [0.0, PRIOR_CURRENT_M_S**2]])
        self.current_ne = np.zeros(2)

    @property
    def std_m(self) -> float:
        if self._knows_current:
            return math.sqrt(self._spread[0, 0])
        return math.hypot(math.sqrt(self._axis.position), PRIOR_CURRENT_M_S * self._blind_s)

    @property
    def current_std_m_s(self) -> float:
        return math.sqrt(self._spread[1, 1])

    def predict(self, dt_s: float) -> None:
        if not self._knows_current:
            self._axis = self._axis.step(self._told, dt_s, has_fix=False)
            self._blind_s += dt_s
            return
        step = np.array([[1.0, dt_s], [0.0, 1.0]])
        self._spread = step @ self._spread @ step.T
        self._spread[0, 0] += self._told.drift_m_sqrt_s**2 * dt_s

    def fix(self, innovation: FloatArray) -> FloatArray:
        """Take a fix that lies so far from where the robot believed to be; return the change."""
        noise = self._told.fix_std_m**2
        if not self._knows_current:
            variance = self.std_m**2
            self._axis = replace(self._axis, position=variance).measure_position(noise)
            self._blind_s = 0.0
            return variance / (variance + noise) * innovation
        gains = self._spread[:, 0] / (self._spread[0, 0] + noise)
        self._spread -= np.outer(gains, self._spread[0])
        self.current_ne = self.current_ne + gains[1] * innovation
        return gains[0] * innovation


class Robot:
    """Follows plans by its own belief of where it is, in water that carries it."""

    def __init__(self, world: World, told: EstimatorConfig, rng: np.random.Generator) -> None:
        self._world, self._told, self._rng = world, told, rng
        self._filter = _Filter(told, world.reckoning)
        self._time_s, self._dive, self._began_s = 0.0, 0, 0.0
        self._believed = np.array([*START_NE_M, 0.0])
        self._error = self._filter.std_m * rng.standard_normal(2)

    @property
    def believed_ne_m(self) -> tuple[float, float]:
        """North and east where the robot believes to be."""
        return float(self._believed[0]), float(self._believed[1])

    def stay(self) -> Flight:
        """Return the one moment before the first dive."""
        true = self._believed - np.array([*self._error, 0.0])
        return Flight(
            np.array([self._time_s]),
            self._believed[None].copy(),
            true[None],
            np.array([self._filter.std_m]),
            np.array([self._dive]),
            (),
        )

    def fly(self, points: FloatArray, planned_start_ne_m: tuple[float, float]) -> Flight:
        """Follow the points of a plan, ``(n, 5)``, that begins at a place."""
        world, rng = self._world, self._rng
        offset = self._believed[:2] - planned_start_ne_m
        began_s, n = self._time_s, len(points)
        believed, true, std = np.empty((n, 3)), np.empty((n, 3)), np.empty(n)
        dive = np.empty(n, dtype=np.int64)
        finished: list[Dive] = []
        for i, point in enumerate(points):
            dt = began_s + point[POINT_TIME] - self._time_s
            offset = offset * math.exp(-dt / _RETURN_S)
            walked = world.walk_m_sqrt_s * math.sqrt(dt) * rng.standard_normal(2)
            carried = dt * (self._filter.current_ne - world.current_ne_m_s)
            self._error = self._error + walked + carried
            planned = point[POINT_NORTH : POINT_EAST + 1]
            reckoned = planned + offset
            here = reckoned - self._error
            self._filter.predict(dt)
            self._time_s += dt
            if point[POINT_DOWN] <= self._told.surface_depth_m:
                finished.append(self._fix(here, reckoned))
                offset = here + self._error - planned
            self._believed = np.array([*(here + self._error), point[POINT_DOWN]])
            believed[i], true[i] = self._believed, (*here, point[POINT_DOWN])
            std[i], dive[i] = self._filter.std_m, self._dive
        return Flight(began_s + points[:, POINT_TIME], believed, true, std, dive, tuple(finished))

    def _fix(self, true_ne: FloatArray, reckoned_ne: FloatArray) -> Dive:
        std_m, current_std_m_s = self._filter.std_m, self._filter.current_std_m_s
        north_m_s, east_m_s = self._filter.current_ne.tolist()
        fixed = true_ne + self._told.fix_std_m * self._rng.standard_normal(2)
        moved = self._filter.fix(fixed - reckoned_ne)
        self._error = self._error + moved
        ended = Dive(
            start_s=self._began_s,
            end_s=self._time_s,
            fix_time_s=self._time_s,
            fix_ne_m=(float(fixed[0]), float(fixed[1])),
            fix_std_m=self._told.fix_std_m,
            reckoned_ne_m=(float(reckoned_ne[0]), float(reckoned_ne[1])),
            reckoned_std_m=std_m,
            believed_ne_m_s=(north_m_s, east_m_s),
            believed_std_m_s=current_std_m_s,
        )
        self._dive += 1
        self._began_s = self._time_s
        return ended


def measured(world: World, flight: Flight, rng: np.random.Generator) -> FieldSamples:
    """Return a sample of each moment of a flight."""
    exact = world.field(flight.true_ned)
    return FieldSamples.of(
        flight.believed_ned,
        np.exp(exact + NOISE * rng.standard_normal(len(exact))),
        flight.std_m,
        dive=flight.dive,
        time_s=flight.time_s,
    )


def flown_by_hand(world: World, rng: np.random.Generator) -> Survey:
    """Lead the robot along random trajectories from surfacing to surfacing."""
    planner = planner_config(SCENARIOS[0], world.told_m_sqrt_s)
    robot = Robot(world, planner.position_filter, rng)
    flights = [robot.stay()]
    samples = measured(world, flights[0], rng)
    domain = planner.domain
    low, high = (domain.x_min_m, domain.y_min_m), (domain.x_max_m, domain.y_max_m)
    while len(samples) < MANUAL_SAMPLES:
        north, east = rng.uniform(low, high).tolist()
        start = inside(robot.believed_ne_m, planner)
        shape = random_shape(planner, rng)
        edge = propose_edge(planner, start, (north, east), planner.round_budget, shape)
        if edge is not None:
            flights.append(robot.fly(edge.points, start))
            samples = joined(samples, measured(world, flights[-1], rng))
    return Survey.of(flights, samples)


def flown_by_plan(
    world: World, field: FieldConfig, scenario: Scenario, rng: np.random.Generator
) -> Survey:
    """Plan a round with the map so far, fly it, and so on until the budget is spent."""
    planner = planner_config(scenario, world.told_m_sqrt_s)
    robot = Robot(world, planner.position_filter, rng)
    flights = [robot.stay()]
    samples = measured(world, flights[0], rng)
    for _ in range(int(planner.total_budget / planner.round_budget)):
        start = inside(robot.believed_ne_m, planner)
        points = _planned(planner, field, samples, start, rng)
        flights.append(robot.fly(points, start))
        samples = joined(samples, measured(world, flights[-1], rng))
    return Survey.of(flights, samples)


def _planned(
    planner: PlannerConfig,
    field: FieldConfig,
    samples: FieldSamples,
    start: tuple[float, float],
    rng: np.random.Generator,
) -> FloatArray:
    result = search.plan(
        planner,
        planning_belief(field, planner, samples),
        start,
        rng=rng,
        budget=planner.round_budget,
        on_progress=lambda _: None,
        is_cancelled=lambda: False,
        elapsed_s=lambda: 0.0,
    )
    if result.best is None:
        raise NoPlanError(result.message)
    return result.best.points


def with_fixes(survey: Survey) -> FieldSamples:
    """Return the samples as the robot located them, with what the fixes said of each dive."""
    samples = survey.samples
    end_s, jump_ne_m = np.full(len(samples), np.nan), np.full((len(samples), 2), np.nan)
    for number, dive in enumerate(survey.finished):
        mine = samples.dive == number
        end_s[mine], jump_ne_m[mine] = dive.fix_time_s, dive.jump_ne_m
    return samples.reckoned(believed=samples.points, end_s=end_s, jump_ne_m=jump_ne_m)
