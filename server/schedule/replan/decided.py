"""A suggestion as a decision: the search, and both plans as they were judged."""

from dataclasses import asdict, replace

from autonomy.planner.plan import Pace
from server.base.decision.kind import DecisionKind
from server.plan.search.decided import outcome_of_search, seed_of
from server.schedule.replan.problem import SUGGEST, SuggestionFound, SuggestionProblem


def _outcome(found: SuggestionFound) -> object:
    return {
        "search": outcome_of_search(found.result),
        "keep": asdict(found.keep),
        "new": None if found.new is None else asdict(found.new),
    }


def _paced(problem: SuggestionProblem, pace: Pace) -> SuggestionProblem:
    return replace(problem, survey=replace(problem.survey, pace=pace))


SUGGESTION = DecisionKind(
    key="suggestion",
    title="Suggestion",
    task=SUGGEST,
    problem=SuggestionProblem,
    outcome=_outcome,
    map_parts=("survey.field", "survey.samples"),
    seed=lambda problem: seed_of(problem.survey),
    pace=lambda found: found.result.pace,
    paced=_paced,
    candidates=lambda found: found.result.candidates,
)
