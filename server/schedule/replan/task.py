"""Searches for another plan and judges both on the same belief, in a worker process.

The measure is the variance of the field at points of the water, by the kernel and the noise that
the planner takes for the map's: after samples where each plan would take them, as surely located as
it promises. Their values nobody needs to know for that.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import solve_triangular

from autonomy.arrays import FloatArray
from autonomy.field.model.kernel import covariance
from autonomy.planner.belief import (
    FieldBelief,
    SampleNoise,
    averaged_samples,
    sample_noise,
)
from autonomy.planner.leg.edge import POINT_STD, surfacings
from autonomy.planner.objective import (
    PAST_SAMPLES_MAX,
    ErgodicMeasure,
    MutualInformation,
    Objective,
    samples_covariance,
    weighted_sum,
)
from autonomy.planner.plan import Candidate, ObjectivePoint
from autonomy.planner.position_error import planned_noise
from autonomy.planner.search.search import independent_points
from server.map.task_model import SCORING
from server.plan.primitive_legs import candidate_of
from server.plan.search import task as search
from server.plan.task import SurveyProblem
from server.schedule.replan.flights import flown
from server.schedule.replan.problem import (
    ComparisonProblem,
    Judged,
    SuggestionFound,
    SuggestionProblem,
)

_JUDGED_SEED = 7
"""The points of the objective are drawn by it, other than the search's."""


def run(
    problem: SuggestionProblem,
    report: Callable[[ObjectivePoint], None],
    is_cancelled: Callable[[], bool],
) -> SuggestionFound:
    """Search for the best plan from the surfacing on, and judge it and what is left of the other.

    What is left is among the trajectories that the search begins with.
    """
    survey = replace(problem.survey, warm=(problem.present, *problem.survey.warm))
    result = search.run(survey, report, is_cancelled)
    judge, best = Judge(survey), result.best
    present = candidate_of(survey.planner, problem.present)

    def judged(candidate: Candidate) -> Judged:
        flights: list[FloatArray] = []
        if problem.flight is not None:
            flights = flown(problem.flight, survey.planner, candidate, is_cancelled)
        return judge.of(candidate, flights)

    return SuggestionFound(
        result=result,
        keep=judged(present),
        new=None if best is None else judged(best),
        samples=len(survey.samples),
    )


def compare(
    problem: ComparisonProblem,
    report: Callable[[float], None],
    is_cancelled: Callable[[], bool],
) -> list[Judged]:
    """Judge each of some plans on the same belief."""
    del is_cancelled
    judge, found = Judge(problem.survey), list[Judged]()
    for number, legs in enumerate(problem.plans, start=1):
        found.append(judge.of(candidate_of(problem.survey.planner, legs)))
        report(number / len(problem.plans))
    return found


class Judge:
    """Judges plans on one belief."""

    def __init__(self, survey: SurveyProblem) -> None:
        """Condition the field on what is known, and on what is sampled before in any case."""
        self._config = survey.planner
        belief = search.belief_of(survey)
        self.points = _judged_points(survey)
        """Where the variance is looked at, shape ``(q, 3)``."""
        self._belief = belief.at(self.points)
        self._noise = sample_noise(survey.planner, belief)
        known = averaged_samples(*belief.known_samples(self._noise), PAST_SAMPLES_MAX)
        self._known = known[0]
        self._factor = np.linalg.cholesky(samples_covariance(belief, *known))
        self._white = self._whitened(self._belief.test_points)  # (n, q)
        self.variance_now = belief.signal_variance - np.square(self._white).sum(axis=0)
        rng = np.random.default_rng([survey.planner.seed, survey.round_number, _JUDGED_SEED])
        drawn = independent_points(survey.planner, survey.site, rng)
        fresh = belief.at(drawn) if len(drawn) else self._belief
        self._objective = _objective(survey, belief, fresh, self._noise)

    def of(self, candidate: Candidate, flights: Sequence[FloatArray] = ()) -> Judged:
        """Judge a trajectory.

        Args:
            candidate: The trajectory.
            flights: Where flights of it sample, each ``(m, 5)``; where there are none the
                trajectory is taken as planned.
        """
        after = [self.variance_after(points) for points in flights or (candidate.points,)]
        mean = np.mean(after, axis=0)
        return Judged(
            removed=float(1.0 - mean.mean() / self.variance_now.mean()),
            map_std=float(np.sqrt(mean).mean()),
            worst_map_std=float(np.sqrt(mean.max())),
            objective=float(self._objective(candidate.points)),
            worst_position_std_m=float(candidate.points[:, POINT_STD].max()),
            energy=candidate.energy,
            duration_s=candidate.duration_s,
            dives=surfacings(candidate.legs),
            flights=len(flights),
        )

    def variance_after(self, points: FloatArray) -> FloatArray:
        """Return the field's variance at the judged points after planned points ``(m, 5)``."""
        belief, kernel = self._belief, self._belief.kernel()
        planned = points[:, 1:4]
        white = self._whitened(planned)  # (n, m)
        own = covariance(planned, planned, kernel) + planned_noise(belief, self._noise, points)
        with_test = covariance(planned, belief.test_points, kernel) - white.T @ self._white
        factor = np.linalg.cholesky(own - white.T @ white)
        taken = solve_triangular(factor, with_test, lower=True)  # (m, q)
        return np.maximum(self.variance_now - np.square(taken).sum(axis=0), 0.0)

    def _whitened(self, places: FloatArray) -> FloatArray:
        if not len(self._known):
            return np.empty((0, len(places)))
        cross = covariance(self._known, places, self._belief.kernel())
        return solve_triangular(self._factor, cross, lower=True)


def _objective(
    survey: SurveyProblem, belief: FieldBelief, fresh: FieldBelief, noise: SampleNoise
) -> Objective:
    """Return the plan's own objective; information gain is asked at points that no search knew."""
    config = survey.planner
    match config.objective:
        case "information_gain":
            return MutualInformation(fresh, noise)
        case "ergodic":
            return ErgodicMeasure(belief, config.ergodic)
        case "weighted":
            return weighted_sum(config, belief, survey.start_xy)


def _judged_points(survey: SurveyProblem) -> FloatArray:
    """Return the points of the water that the variance is the mean over, ``(q, 3)``."""
    points = search.water_points(survey.planner.domain, survey.site, SCORING)
    area = survey.planner.area
    if area is None:
        return points
    inside = area.contains(points[:, 0], points[:, 1])
    return points[inside] if inside.any() else points
