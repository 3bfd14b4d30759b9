"""What a search hands back: trajectories as values, and the sentence that a person reads."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from autonomy.planner.config import PlannerConfig
from autonomy.planner.edge import POINT_STD, POINT_TIME, Edge, legs_duration_s
from autonomy.planner.plan import Candidate, ObjectivePoint, PlanResult, PlanStatus, PrimitiveKind
from autonomy.planner.primitive import energy

_PROGRESS_PERIOD_S = 0.2
_MINUTE_S = 60.0


@dataclass(slots=True)
class Progress:
    """What is known while a search runs, and who is told about it."""

    elapsed_s: Callable[[], float]
    is_cancelled: Callable[[], bool]
    on_progress: Callable[[ObjectivePoint], None]
    time_limit_s: float
    candidates: int = 0
    best: float = -math.inf
    cancelled: bool = False
    history: list[ObjectivePoint] = field(default_factory=list)
    _told_at_s: float = -math.inf

    def must_end(self) -> bool:
        """Tell whether time is up or somebody cancelled; report progress about 5 times a second."""
        now = self.elapsed_s()
        if math.isfinite(self.best) and now - self._told_at_s >= _PROGRESS_PERIOD_S:
            self._told_at_s = now
            self.on_progress(ObjectivePoint(now, self.best, self.candidates))
        self.cancelled = self.cancelled or self.is_cancelled()
        return self.cancelled or now >= self.time_limit_s

    def improve(self, objective: float) -> None:
        """Note a better objective."""
        self.best = objective
        self.history.append(ObjectivePoint(self.elapsed_s(), objective, self.candidates))


def as_candidate(config: PlannerConfig, edges: Sequence[Edge], objective: float) -> Candidate:
    """Join edges into one trajectory; the times of its points leave out the surfacings."""
    points: list[np.ndarray] = []
    start_s = 0.0
    for edge in edges:
        shifted = edge.points.copy()
        shifted[:, POINT_TIME] += start_s
        points.append(shifted)
        start_s += sum(leg.duration_s for leg in edge.legs)
    joined = np.concatenate(points)
    legs = tuple(leg for edge in edges for leg in edge.legs)
    return Candidate(
        legs=legs,
        points=joined,
        objective=objective,
        energy=sum(edge.energy for edge in edges),
        duration_s=legs_duration_s(config, legs),
        worst_std_m=float(joined[:, POINT_STD].max()),
    )


def least_energy(config: PlannerConfig) -> float:
    """Return a lower bound on the energy between two surfacings."""
    limits = config.primitives
    change = limits.depth_change_min_m
    descents = [
        2.0 * energy(kind, change / speed, config.energy)
        for kind, speed in (
            (PrimitiveKind.GLIDE, limits.glide_speed_m_s),
            (PrimitiveKind.SPIRAL, limits.spiral_speed_m_s),
            (PrimitiveKind.DIVE, limits.dive_speed_m_s),
        )
    ]
    swim_s = limits.swim_length_min_m / limits.swim_speed_m_s
    cheapest = min(*descents, energy(PrimitiveKind.SWIM, swim_s, config.energy))
    return cheapest + config.surfacing_energy


def obstacle(
    config: PlannerConfig, start_xy: tuple[float, float], budget: float
) -> PlanResult | None:
    """Return a result that says why nothing can be planned, or None if something may be."""
    x, y = start_xy
    domain = config.domain
    cheapest = least_energy(config)
    if not (math.isfinite(x) and math.isfinite(y)):
        reason = "the start position is unknown"
    elif not domain.contains(x, y, 0.0):
        reason = (
            f"the start ({x:.2f} m north, {y:.2f} m east) is outside the domain "
            f"({domain.x_min_m:g} to {domain.x_max_m:g} m north, "
            f"{domain.y_min_m:g} to {domain.y_max_m:g} m east)"
        )
    elif budget < cheapest:
        reason = (
            f"a budget of {budget:.3g} energy units is below the cheapest way "
            f"from one surfacing to another, {cheapest:.3g}"
        )
    else:
        return None
    return nothing_feasible(f"No trajectory: {reason}.")


def nothing_feasible(message: str, progress: Progress | None = None) -> PlanResult:
    """Return the result of a search that found no trajectory at all."""
    cancelled = progress is not None and progress.cancelled
    return PlanResult(
        status=PlanStatus.CANCELLED if cancelled else PlanStatus.NOTHING_FEASIBLE,
        message="Planning was stopped before any trajectory was found." if cancelled else message,
        best=None,
        runners_up=(),
        history=(),
        candidates=progress.candidates if progress else 0,
        reservoir_full=False,
    )


def dead_end(
    config: PlannerConfig, start_xy: tuple[float, float], progress: Progress
) -> PlanResult:
    """Return the result of a search whose every proposal broke a limit."""
    return nothing_feasible(
        f"No trajectory from {start_xy[0]:.2f} m north, {start_xy[1]:.2f} m east met every limit: "
        f"domain, {config.max_uncertainty_m:g} m of position uncertainty, and energy. "
        "Allow more uncertainty, a larger domain, or more planning time.",
        progress,
    )


def offered(
    config: PlannerConfig,
    budget: float,
    trajectories: Sequence[Candidate],
    progress: Progress,
    reservoir_full: bool,
) -> PlanResult:
    """Return the result of a search that found trajectories, best first."""
    best = trajectories[0]
    progress.history.append(
        ObjectivePoint(progress.elapsed_s(), best.objective, progress.candidates)
    )
    result = PlanResult(
        status=PlanStatus.CANCELLED if progress.cancelled else PlanStatus.FOUND,
        message="",
        best=best,
        runners_up=tuple(trajectories[1:]),
        history=tuple(progress.history),
        candidates=progress.candidates,
        reservoir_full=reservoir_full,
    )
    return replace(result, message=sentence(config, budget, result, best))


def sentence(config: PlannerConfig, budget: float, result: PlanResult, best: Candidate) -> str:
    """Return what a person reads of a search that found ``best``, by the account of ``best``.

    Args:
        config: What was asked for.
        budget: Energy units of the round.
        result: How the search went.
        best: The trajectory that is offered.
    """
    text = (
        f"spends {best.energy:.1f} of {budget:.4g} energy units in {_duration(best.duration_s)}, "
        f"position uncertainty at most {best.worst_std_m:.2g} m, {_worth(config, best)}."
    )
    least = config.search.min_budget_fraction * budget
    if best.energy <= least:
        text = (
            f"No trajectory spends more than {least:.3g} energy units; the best shorter one {text}"
        )
    elif result.status is PlanStatus.CANCELLED:
        text = f"Stopped early; the best trajectory so far {text}"
    else:
        text = f"The best of {result.candidates:,} trajectories {text}"
    if result.reservoir_full:
        text += (
            f" Not every path was kept: the limit is {config.search.paths_per_node} a surfacing."
        )
    return text


def _worth(config: PlannerConfig, best: Candidate) -> str:
    if config.objective == "ergodic":
        return f"ergodic measure {best.objective:.3f}"
    return f"{best.objective:.1f} nats of information"


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), int(_MINUTE_S))
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"
