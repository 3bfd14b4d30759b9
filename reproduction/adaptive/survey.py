"""The loop of thesis Figure 5.3: plan a round, fly it, measure, update the map, plan the next."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.estimation.smoother import Dive, smooth_dive
from autonomy.field import synthetic
from autonomy.field.config import FieldConfig, GridShape
from autonomy.field.grid import Grid
from autonomy.field.model.model import condition
from autonomy.field.samples import FieldSamples, joined
from autonomy.planner.belief import FieldBelief
from autonomy.planner.config import PlannerConfig
from autonomy.planner.search import search
from reproduction.adaptive.point_robot import Flight, PointRobot
from reproduction.adaptive.scenario import START_NE_M

PLANNING_GRID = GridShape(x=10, y=6, z=4)
"""Points that stand for the domain while planning."""


@dataclass(frozen=True, slots=True, eq=False)
class Survey:
    """What a survey brought home."""

    samples: FieldSamples
    """As the robot located them."""
    true_points: FloatArray
    """Where they were taken, shape ``(n, 3)``, m."""
    finished: tuple[Dive, ...]
    """The finished dives, in order."""

    @classmethod
    def of(cls, flights: Sequence[Flight], samples: FieldSamples) -> Self:
        """Return what flights brought home, ``samples`` in their order."""
        return cls(
            samples,
            np.concatenate([flight.true_ned for flight in flights]),
            tuple(dive for flight in flights for dive in flight.finished),
        )

    def smoothed(self) -> FieldSamples:
        """Return the samples located anew by the fixes that ended their dives."""
        points, std_m = self.samples.points.copy(), self.samples.position_std_m.copy()
        for number, dive in enumerate(self.finished):
            mine = self.samples.dive == number
            better = smooth_dive(dive, self.samples.time_s[mine], points[mine], std_m[mine])
            points[mine], std_m[mine] = better.position_ned, better.position_std_m
        located = replace(self.samples, points=points, position_std_m=std_m)
        return located.reckoned(believed=self.samples.points)


class NoPlanError(Exception):
    """A round for which the planner found no trajectory; the message says why."""


def run_survey(
    field: FieldConfig,
    planner: PlannerConfig,
    drift_m_sqrt_s: float,
    rng: np.random.Generator,
    is_cancelled: Callable[[], bool] = lambda: False,
) -> Survey:
    """Survey a synthetic field with a point robot until the total budget is spent.

    Every planned point is a sample, and there is one of the start.

    Args:
        field: Variable, and the model that is mapped and planned with.
        planner: Budgets, primitives, and a ``search.iterations_max`` that ends each search.
        drift_m_sqrt_s: True drift; ``planner.position_filter`` holds the believed one.
        rng: Draws plans, errors and noise.
        is_cancelled: Asked while planning.

    Raises:
        NoPlanError: If a round has no plan.
    """
    robot = PointRobot(planner.position_filter, drift_m_sqrt_s, START_NE_M, rng)
    flights = [robot.stay()]
    samples = measured(field.variable, flights[0], rng)
    for _ in range(int(planner.total_budget / planner.round_budget)):
        start = inside(robot.believed_ne_m, planner)
        result = search.plan(
            planner,
            planning_belief(field, planner, samples),
            start,
            rng=rng,
            budget=planner.round_budget,
            on_progress=lambda _: None,
            is_cancelled=is_cancelled,
            elapsed_s=lambda: 0.0,
        )
        if result.best is None or is_cancelled():
            raise NoPlanError(result.message)
        flights.append(robot.fly(result.best.points, start))
        samples = joined(samples, measured(field.variable, flights[-1], rng))
    return Survey.of(flights, samples)


def measured(variable: str, flight: Flight, rng: np.random.Generator) -> FieldSamples:
    """Return a sample of each moment of a flight."""
    return FieldSamples.of(
        flight.believed_ned,
        synthetic.measure(variable, flight.true_ned, rng),
        flight.std_m,
        dive=flight.dive,
        time_s=flight.time_s,
    )


def inside(believed_ne_m: tuple[float, float], planner: PlannerConfig) -> tuple[float, float]:
    """Return the nearest place of the domain: a fix may show the robot just outside of it."""
    domain = planner.domain
    return (
        min(max(believed_ne_m[0], domain.x_min_m), domain.x_max_m),
        min(max(believed_ne_m[1], domain.y_min_m), domain.y_max_m),
    )


def planning_belief(
    field: FieldConfig, planner: PlannerConfig, samples: FieldSamples
) -> FieldBelief:
    """Return what a round is planned with: the map so far, at points that stand for the domain."""
    targets = Grid.over(planner.domain, PLANNING_GRID).points
    mean, variance = condition(field, samples).marginals(targets)
    return FieldBelief(
        signal_variance=field.single.signal_variance,
        length_scales_m=field.single.length_scales_m(),
        noise_variance=field.single.noise_variance,
        sample_points=samples.points,
        test_points=targets,
        mean=mean,
        std=np.sqrt(variance),
        sample_position_std=samples.position_std_m,
    )
