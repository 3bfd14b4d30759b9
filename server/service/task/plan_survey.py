"""Plans one round of a survey from the map of its site and the robot's position."""

import time
from collections.abc import Callable
from functools import cache

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.field.config import FieldConfig
from autonomy.field.samples import FieldSamples
from autonomy.planner import kernel
from autonomy.planner.approach import approach, approach_energy, preceded
from autonomy.planner.belief import FieldBelief
from autonomy.planner.plan import ObjectivePoint, PlanResult
from autonomy.planner.search import plan
from autonomy.site import Box
from server.service.task.problem import MapProblem, SurveyProblem
from server.service.task.survey_map import PLANNING, SCORING, domain_points, map_of

_BELIEF_SAMPLES = 4000


def run(
    problem: SurveyProblem,
    report: Callable[[ObjectivePoint], None],
    is_cancelled: Callable[[], bool],
) -> PlanResult:
    """Search for the best trajectory; progress is the best objective so far."""
    load_kernels()
    belief = belief_of(problem)
    began_s = time.monotonic()
    first = approach(problem.planner, problem.start_xy)
    chance = [problem.planner.seed, problem.round_number]
    result = plan(
        problem.planner,
        belief,
        problem.start_xy if first is None else first.end_ned[:2],
        rng=np.random.default_rng([*chance, problem.attempt] if problem.attempt else chance),
        budget=problem.budget - approach_energy(problem.planner, first),
        on_progress=report,
        is_cancelled=is_cancelled,
        elapsed_s=lambda: time.monotonic() - began_s,
    )
    if first is None:
        return result
    return preceded(result, first, problem.planner, problem.budget)


def mean_std(
    problem: MapProblem, report: Callable[[None], None], is_cancelled: Callable[[], bool]
) -> float:
    """Return the standard deviation of a map, the mean over the water of the domain.

    It is in the scale of the field's model.
    """
    del report, is_cancelled
    points = domain_points(problem.planner.domain, SCORING)
    _, std = _predicted(problem.field, problem.planner.domain, problem.samples, points)
    return float(std.mean())


def belief_of(problem: SurveyProblem) -> FieldBelief:
    """Return what the samples say about the water of the domain, and what plans will add."""
    config, domain = problem.field, problem.planner.domain
    points = domain_points(domain, PLANNING)
    mean, std = _predicted(config, domain, problem.samples, points)
    kept = _spread(len(problem.samples), _BELIEF_SAMPLES)
    return FieldBelief(
        signal_variance=config.single.signal_variance,
        length_scales_m=config.single.length_scales_m(),
        noise_variance=config.single.noise_variance,
        sample_points=problem.samples.points[kept],
        test_points=points,
        mean=mean,
        std=std,
        sample_position_std=problem.samples.position_std_m[kept],
    )


@cache
def load_kernels() -> None:
    """Load or compile the planner's machine code, once in this process.

    It takes a second, or half a minute where there is no code on disk yet; a search must not pay
    for that from its planning time.
    """
    kernel.warm_up()


def load(payload: None, report: Callable[[None], None], is_cancelled: Callable[[], bool]) -> None:
    """Make this process ready to plan at once."""
    del payload, report, is_cancelled
    load_kernels()


def _predicted(
    config: FieldConfig, domain: Box, samples: FieldSamples, points: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return mean and standard deviation of the configured map at points, each ``(q,)``."""
    prediction = map_of(config, domain, samples).predict(points)
    return prediction.mean, np.sqrt(np.maximum(np.diagonal(prediction.covariance), 0.0))


def _spread(count: int, limit: int) -> IntArray:
    """Return the indices of at most ``limit`` of ``count`` samples, evenly spread in time."""
    return np.unique(np.linspace(0, max(count - 1, 0), min(count, limit)).round().astype(np.int64))
