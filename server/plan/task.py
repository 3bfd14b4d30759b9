"""What tasks are given, and their names: all that the station needs to know of them.

The tasks' own modules load numba, so the station never imports them.
"""

import dataclasses
from dataclasses import dataclass
from typing import Final

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.config import FieldConfig
from autonomy.field.samples import FieldSamples
from autonomy.planner.config import PlannerConfig
from autonomy.planner.plan import Leg, Pace
from autonomy.site import Site

LOAD_PLANNER: Final = "server.plan.search.task:load"
"""Takes nothing and leaves nothing."""
PLAN_SURVEY: Final = "server.plan.search.task:run"
"""Takes a ``SurveyProblem``, reports ``ObjectivePoint``, leaves a ``PlanResult``."""
MAP_STD: Final = "server.plan.search.task:mean_std"
"""Takes a ``MapProblem``, leaves the mean standard deviation of the map over the domain."""


def _no_points() -> FloatArray:
    return np.empty((0, 3))


def _no_std() -> FloatArray:
    return np.empty(0)


@dataclass(frozen=True, slots=True)
class SurveyProblem:
    """One round of a survey that is to be planned."""

    planner: PlannerConfig
    field: FieldConfig
    samples: FieldSamples
    """Of every robot of the site."""
    start_xy: tuple[float, float]
    budget: float
    round_number: int
    """Rounds of one mission search with different random numbers."""
    site: Site | None = None
    """The water with its shoreline and floor; ``None`` for the domain alone."""
    warm: tuple[tuple[Leg, ...], ...] = ()
    """Trajectories to begin with, as far as they fit."""
    planned_points: FloatArray = dataclasses.field(default_factory=_no_points)
    """Where samples will be taken by plans that are under way, shape ``(m, 3)``, NED, m."""
    planned_std_m: FloatArray = dataclasses.field(default_factory=_no_std)
    """Standard deviation of the horizontal position there, shape ``(m,)``."""
    attempt: int = 0
    """Searches that go on from an earlier one use other random numbers."""
    pace: Pace | None = None
    """How far this search came before; with it the same search is repeated without a clock."""


@dataclass(frozen=True, slots=True)
class MapProblem:
    """A map whose uncertainty is asked for."""

    planner: PlannerConfig
    field: FieldConfig
    samples: FieldSamples
    site: Site | None = None
