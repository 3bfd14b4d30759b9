"""Plans one round of a survey from the map of its site and the robot's position."""

import time
from collections.abc import Callable
from functools import cache

import numpy as np

from autonomy.arrays import FloatArray, evenly_spread
from autonomy.field.config import FieldConfig
from autonomy.field.mask import water_mask
from autonomy.field.samples import FieldSamples
from autonomy.planner.approach import after_approach, approach_energy, preceded, shortfall, way_in
from autonomy.planner.belief import FieldBelief, planning_kernel
from autonomy.planner.outcome import nothing_feasible
from autonomy.planner.plan import Leg, ObjectivePoint, PlanResult
from autonomy.planner.search import kernel
from autonomy.planner.search.search import plan
from autonomy.site import Box, Site
from server.map.task_model import PLANNING, SCORING, domain_points, map_of
from server.plan.task import MapProblem, SurveyProblem

_BELIEF_SAMPLES = 4000


def run(
    problem: SurveyProblem,
    report: Callable[[ObjectivePoint], None],
    is_cancelled: Callable[[], bool],
) -> PlanResult:
    """Search for the best trajectory; progress is the best objective so far."""
    load_kernels(problem.planner.objective)
    belief = belief_of(problem)
    began_s = time.monotonic()
    way = way_in(problem.planner, problem.start_xy, problem.site)
    if way.refusal:
        return nothing_feasible(f"No trajectory: {way.refusal}")
    too_little = shortfall(problem.planner, way.legs, problem.budget)
    if too_little:
        return nothing_feasible(f"No trajectory: {too_little}.")
    chance = [problem.planner.seed, problem.round_number]
    result = plan(
        after_approach(problem.planner, way.legs),
        belief,
        way.end_xy,
        rng=np.random.default_rng([*chance, problem.attempt] if problem.attempt else chance),
        budget=problem.budget - approach_energy(problem.planner, way.legs),
        site=problem.site,
        warm=[without_approach(legs, way.legs) for legs in problem.warm],
        on_progress=report,
        is_cancelled=is_cancelled,
        pace=problem.pace,
        elapsed_s=lambda: time.monotonic() - began_s,
    )
    return preceded(result, way.legs, problem.planner, problem.budget)


def mean_std(
    problem: MapProblem, report: Callable[[None], None], is_cancelled: Callable[[], bool]
) -> float:
    """Return the standard deviation of a map, the mean over the water of the domain.

    It is in the scale of the field's model.
    """
    del report, is_cancelled
    points = water_points(problem.planner.domain, problem.site, SCORING)
    _, std = _predicted(problem.field, problem.planner.domain, problem.samples, points)
    return float(std.mean())


def belief_of(problem: SurveyProblem) -> FieldBelief:
    """Return what the samples say about the water of the domain, and what plans will add."""
    config, domain = problem.field, problem.planner.domain
    points = water_points(domain, problem.site, PLANNING)
    mean, std = _predicted(config, domain, problem.samples, points)
    kept = evenly_spread(len(problem.samples), _BELIEF_SAMPLES)
    kernel_of_map = planning_kernel(config)
    return FieldBelief(
        signal_variance=kernel_of_map.signal_variance,
        length_scales_m=kernel_of_map.length_scales_m(),
        noise_variance=kernel_of_map.noise_variance,
        sample_points=problem.samples.points[kept],
        test_points=points,
        mean=mean,
        std=std,
        sample_position_std=problem.samples.position_std_m[kept],
        planned_points=problem.planned_points,
        planned_std=problem.planned_std_m,
        shape=kernel_of_map.shape,
        counts="levels" if config.model in {"recursive", "joint"} else "noise",
    )


def without_approach(legs: tuple[Leg, ...], way: tuple[Leg, ...]) -> tuple[Leg, ...]:
    """Return an earlier trajectory without the swims into the domain that it began with.

    Args:
        legs: The trajectory.
        way: The swims that the new one begins with; none where it begins at once.
    """
    count = 0
    while count < min(len(way), len(legs)) and legs[count].end_ned == way[count].end_ned:
        count += 1
    return legs[count:]


def water_points(domain: Box, site: Site | None, resolution: tuple[int, int]) -> FloatArray:
    """Return the points that stand for a domain, those in the water, shape ``(q, 3)``.

    Where all of them are on land they are returned as they are; no plan is found there anyway.
    """
    points = domain_points(domain, resolution)
    if site is None:
        return points
    is_water = water_mask(site, points)
    return points[is_water] if is_water.any() else points


@cache
def load_kernels(objective: kernel.Objective) -> None:
    """Load or compile the planner's machine code for an objective, once in this process.

    It takes a second, or a minute where there is no code on disk yet; a search must not pay for
    that from its planning time.
    """
    kernel.warm_up(objective)


def load(payload: None, report: Callable[[None], None], is_cancelled: Callable[[], bool]) -> None:
    """Make this process ready to plan at once by the usual objective."""
    del payload, report, is_cancelled
    load_kernels(kernel.OBJECTIVES[0])


def _predicted(
    config: FieldConfig, domain: Box, samples: FieldSamples, points: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return mean and standard deviation of the configured map at points, each ``(q,)``."""
    mean, variance = map_of(config, domain, samples).conditioned().marginals(points)
    return mean, np.sqrt(np.maximum(variance, 0.0))
