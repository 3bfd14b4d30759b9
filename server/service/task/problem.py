"""What tasks are given, and their names: all that the station needs to know of them.

The tasks' own modules load numba, so the station never imports them.
"""

from dataclasses import dataclass
from typing import Final

from autonomy.arrays import FloatArray
from autonomy.field.config import FieldConfig
from autonomy.planner.config import PlannerConfig
from autonomy.site import Box

LOAD_PLANNER: Final = "server.service.task.plan_survey:load"
"""Takes nothing and leaves nothing."""
PLAN_SURVEY: Final = "server.service.task.plan_survey:run"
"""Takes a ``SurveyProblem``, reports ``ObjectivePoint``, leaves a ``PlanResult``."""
SCORE_SURVEY: Final = "server.service.task.score_survey:run"
"""Takes a ``ScoreProblem``, leaves ``Scores`` by model."""


@dataclass(frozen=True, slots=True)
class MapSamples:
    """Samples of one variable in order of time."""

    points: FloatArray
    """Shape ``(n, 3)``, NED, m."""
    values: FloatArray
    """Shape ``(n,)``, in the variable's unit."""
    position_std_m: FloatArray
    """Shape ``(n,)``."""

    def __len__(self) -> int:
        return len(self.values)


@dataclass(frozen=True, slots=True)
class SurveyProblem:
    """One round of a survey that is to be planned."""

    planner: PlannerConfig
    field: FieldConfig
    samples: MapSamples
    start_xy: tuple[float, float]
    budget: float
    round_number: int
    """Rounds of one mission search with different random numbers."""


@dataclass(frozen=True, slots=True)
class ScoreProblem:
    """Samples of a survey, and the domain that it was to explore."""

    field: FieldConfig
    domain: Box
    samples: MapSamples
