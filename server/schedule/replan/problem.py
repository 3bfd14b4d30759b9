"""What the search for a suggestion is given and leaves; this module loads no numba."""

from dataclasses import dataclass
from typing import Final

from autonomy.planner.plan import Leg, PlanResult
from robot_link.dry_run import DryRunProblem
from server.plan.task import SurveyProblem

SUGGEST: Final = "server.schedule.replan.task:run"
"""Takes a ``SuggestionProblem``, reports ``ObjectivePoint``, leaves a ``SuggestionFound``."""
COMPARE: Final = "server.schedule.replan.task:compare"
"""Takes a ``ComparisonProblem``, leaves a ``Judged`` for each plan."""


@dataclass(frozen=True, slots=True)
class SuggestionProblem:
    """What is left of a plan, and the round that may take its place."""

    survey: SurveyProblem
    """From the surfacing on; what is flown until then is among its planned points."""
    present: tuple[Leg, ...]
    """What is left."""
    flight: DryRunProblem | None = None
    """Robot and water that both plans are flown ahead in; ``None`` where the vehicle is not known,
    and both are judged as they are planned."""


@dataclass(frozen=True, slots=True)
class ComparisonProblem:
    """Plans that are judged as they are written, each as if it alone were flown."""

    survey: SurveyProblem
    """The belief that they are judged on."""
    plans: tuple[tuple[Leg, ...], ...]


@dataclass(frozen=True, slots=True)
class Judged:
    """What legs are expected to bring, on the belief that both plans are judged on."""

    removed: float
    """Part of the map's variance that they take away, the mean over the water, 0..1."""
    map_std: float
    """Mean standard deviation of the map after them, in the scale of the field's model."""
    worst_map_std: float
    objective: float
    """By the plan's objective, on points that no search knew."""
    worst_position_std_m: float
    energy: float
    duration_s: float
    dives: int
    flights: int
    """Flights ahead that ``removed`` and the map's deviations are the mean of; 0 where it was
    judged as planned."""


@dataclass(frozen=True, slots=True)
class SuggestionFound:
    """A search's result beside what is left of the present plan."""

    result: PlanResult
    keep: Judged
    new: Judged | None
    """``None`` where nothing was found that keeps every limit."""
    samples: int
    """In the belief."""
