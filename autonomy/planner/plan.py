"""A plan as a value: legs that a robot can fly, and the points that a planner promises."""

from dataclasses import dataclass
from enum import StrEnum

from autonomy.arrays import FloatArray

PositionNed = tuple[float, float, float]
"""North, east, down in the site's frame, m; down is depth and never negative."""


class PrimitiveKind(StrEnum):
    """The four motion primitives (thesis Table 5.1), and keeping a place at the surface.

    No search makes a ``KEEP``; people ask for it.
    """

    GLIDE = "glide"
    SPIRAL = "spiral"
    DIVE = "dive"
    SWIM = "swim"
    KEEP = "keep"


@dataclass(frozen=True, slots=True)
class Leg:
    """One motion primitive, from a point to a point, both in the site's NED frame.

    ``speed_m_s`` is the vertical speed (a magnitude) of a glide, spiral or dive, and the speed
    over ground of a swim. A spiral turns by ``turn_rad`` (positive to starboard, seen from above
    clockwise) on a circle of ``radius_m``, entered at ``heading_rad``; both are 0 for the others.
    A keep stays within ``radius_m`` of its end, which lies at the surface, for its duration; its
    speed is that of swimming back, through the water.
    """

    kind: PrimitiveKind
    start_ned: PositionNed
    end_ned: PositionNed
    speed_m_s: float
    duration_s: float
    energy: float
    """Energy units of thesis section 5.5.2: a dive 1, a glide or spiral 1.5, and time."""
    heading_rad: float = 0.0
    radius_m: float = 0.0
    turn_rad: float = 0.0


class PlanStatus(StrEnum):
    """How a planning run ended; a person reads ``PlanResult.message``."""

    FOUND = "found"
    NOTHING_FEASIBLE = "nothing_feasible"
    CANCELLED = "cancelled"


@dataclass(frozen=True, slots=True)
class ObjectivePoint:
    """The best objective known after some planning time, for the curve the operator watches."""

    elapsed_s: float
    objective: float
    candidates: int


@dataclass(frozen=True, slots=True)
class Candidate:
    """One trajectory that the planner could offer."""

    legs: tuple[Leg, ...]
    points: FloatArray
    """Shape ``(n, 5)``: time from the start s, north m, east m, down m, position std m."""
    objective: float
    """What it is worth; information gain is that at points which the search did not know."""
    energy: float
    duration_s: float
    worst_std_m: float
    searched: float | None = None
    """What the search itself took it to be worth; None where no search did."""


@dataclass(frozen=True, slots=True)
class Pace:
    """How far a search came by the clock; with it the same search is repeated without one."""

    iterations: int
    """Growths and refinements that were made."""
    turns: tuple[tuple[int, float], ...] = ()
    """Where it went on from another start: before which iteration, counted from 0, and which part
    of the search was over then, 0..1."""

    def part(self, iteration: int) -> float:
        """Return the part of the search that counts before an iteration."""
        return max((part for first, part in self.turns if first <= iteration), default=0.0)


@dataclass(frozen=True, slots=True)
class PlanResult:
    """What a planning run leaves: best candidate, runners-up, and how it went."""

    status: PlanStatus
    message: str
    best: Candidate | None
    runners_up: tuple[Candidate, ...]
    history: tuple[ObjectivePoint, ...]
    candidates: int
    """Budget-feasible candidates whose objective was known or bounded."""
    reservoir_full: bool
    """Whether some node met the cap on its paths, so that not every path was kept."""
    pace: Pace | None = None
    """How far the search came; ``None`` where there was none."""
