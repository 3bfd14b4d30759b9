"""The search for a round as a decision: what of it counts, and how it is repeated."""

from dataclasses import asdict, replace

from autonomy.planner.plan import Candidate, Pace, PlanResult
from robot_link.mission import leg_integers
from server.base.decision.kind import DecisionKind
from server.plan.task import MAP_STD, PLAN_SURVEY, MapProblem, SurveyProblem


def outcome_of_search(result: PlanResult) -> object:
    """Return what counts of a search: its trajectories in the integers that travel to the robot."""
    found = [] if result.best is None else [result.best, *result.runners_up]
    return {
        "status": result.status.value,
        "candidates": result.candidates,
        "message": result.message,
        "trajectories": [_trajectory(one) for one in found],
    }


def seed_of(problem: SurveyProblem) -> tuple[int, ...]:
    """Return what the random numbers of a search begin with."""
    return problem.planner.seed, problem.round_number, problem.attempt


def _trajectory(candidate: Candidate) -> object:
    try:
        legs: object = [leg_integers(leg, leg.start_ned) for leg in candidate.legs]
    except ValueError:  # it is too far for the wire, and becomes no draft
        legs = [asdict(leg) for leg in candidate.legs]
    return {
        "legs": legs,
        "objective": candidate.objective,
        "energy": candidate.energy,
        "worst_std_m": candidate.worst_std_m,
    }


def _paced(problem: SurveyProblem, pace: Pace) -> SurveyProblem:
    return replace(problem, pace=pace)


SURVEY_ROUND = DecisionKind(
    key="plan",
    title="Plan of a round",
    task=PLAN_SURVEY,
    problem=SurveyProblem,
    outcome=outcome_of_search,
    map_parts=("field", "samples"),
    seed=seed_of,
    pace=lambda result: result.pace,
    paced=_paced,
    candidates=lambda result: result.candidates,
)


def _uncertainty(std: float) -> object:
    return {"std": std}


MAP_UNCERTAINTY = DecisionKind(
    key="uncertainty",
    title="Uncertainty of a map, by which a survey ends",
    task=MAP_STD,
    problem=MapProblem,
    outcome=_uncertainty,
    map_parts=("field", "samples"),
)
