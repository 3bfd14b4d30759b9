"""What a search hands back: trajectories as values, and the sentence that a person reads."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg import drift
from autonomy.planner.leg.edge import (
    POINT_STD,
    POINT_TIME,
    Edge,
    legs_duration_s,
    legs_energy,
    surfacings,
)
from autonomy.planner.leg.primitive import energy
from autonomy.planner.leg.waterway import closed_areas, usable_depth_m
from autonomy.planner.plan import (
    Candidate,
    Leg,
    ObjectivePoint,
    PlanResult,
    PlanStatus,
    PrimitiveKind,
)
from autonomy.site import Site

_PROGRESS_PERIOD_S = 0.2
_MINUTE_S = 60.0


@dataclass(frozen=True, slots=True)
class Spending:
    """What a trajectory takes of each budget."""

    energy: float
    duration_s: float
    satellite_bytes: float

    def __add__(self, other: "Spending") -> "Spending":
        """Return what both take."""
        return Spending(
            self.energy + other.energy,
            self.duration_s + other.duration_s,
            self.satellite_bytes + other.satellite_bytes,
        )

    def greatest_share(self, config: PlannerConfig, budget: float) -> float:
        """Return the greatest part of a budget that is spent.

        Args:
            config: Budgets of time and satellite bytes; 0 sets none.
            budget: Energy units of the round.
        """
        shares = [self.energy / budget]
        if config.time_budget_s > 0.0:
            shares.append(self.duration_s / config.time_budget_s)
        if config.satellite_bytes > 0:
            shares.append(self.satellite_bytes / config.satellite_bytes)
        return max(shares)


def spending(config: PlannerConfig, legs: Sequence[Leg]) -> Spending:
    """Return what legs take, with what prepares them at the surface."""
    return Spending(
        legs_energy(config, legs),
        legs_duration_s(config, legs),
        float(surfacings(legs) * config.mission.surfacing_bytes),
    )


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


def as_candidate(
    config: PlannerConfig,
    edges: Sequence[Edge],
    objective: float,
    searched: float | None = None,
) -> Candidate:
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
        searched=searched,
    )


def are_alike(one: Candidate, other: Candidate, close_m: float) -> bool:
    """Tell whether more than half of the surfacings of two trajectories are close together."""
    places = [
        np.array([leg.end_ned[:2] for leg in each.legs if leg.end_ned[2] <= 0.0])
        for each in (one, other)
    ]
    away = np.linalg.norm(places[0][:, None] - places[1][None], axis=2)  # (n, m)
    return 2 * int((away.min(axis=1) < close_m).sum()) > min(away.shape)


def least_energy(config: PlannerConfig) -> float:
    """Return a lower bound on the energy between two surfacings."""
    return least_spending(config).energy


def least_spending(config: PlannerConfig) -> Spending:
    """Return lower bounds on what is spent between two surfacings."""
    limits = config.primitives
    change = limits.depth_change_min_m
    ways = [
        (kind, 2.0, change / speed)
        for kind, speed in (
            (PrimitiveKind.GLIDE, limits.glide_speed_m_s),
            (PrimitiveKind.SPIRAL, limits.spiral_speed_m_s),
            (PrimitiveKind.DIVE, limits.dive_speed_m_s),
        )
    ]
    fastest_swim = limits.swim_speed_m_s + drift.speed_m_s(config)
    ways.append((PrimitiveKind.SWIM, 1.0, limits.swim_length_min_m / fastest_swim))
    least = min(number * energy(kind, time_s, config.energy) for kind, number, time_s in ways)
    least_s = min(number * time_s for _, number, time_s in ways)
    return Spending(
        least + config.surfacing_energy,
        least_s + config.mission.turn_time_s,
        0.0,  # a swim along the surface ends with no surfacing
    )


def obstacle(
    config: PlannerConfig,
    start_xy: tuple[float, float],
    budget: float,
    site: Site | None = None,
) -> PlanResult | None:
    """Return a result that says why nothing can be planned, or None if something may be.

    Args:
        config: Domain, limits and prices.
        start_xy: North and east where the robot is, m.
        budget: Energy units of the round.
        site: Shore and floor; None for water without end.
    """
    reason = _misplaced(config, start_xy, site) or _too_dear(config, budget)
    return nothing_feasible(f"No trajectory: {reason}.") if reason else None


def _misplaced(config: PlannerConfig, start_xy: tuple[float, float], site: Site | None) -> str:
    """Return what is wrong with the domain or the start in it, "" if nothing."""
    x, y = start_xy
    domain = config.domain
    if domain.x_max_m <= domain.x_min_m or domain.y_max_m <= domain.y_min_m:
        return "the domain has no volume"
    if not (math.isfinite(x) and math.isfinite(y)):
        return "the start position is unknown"
    if not domain.contains(x, y, 0.0):
        return (
            f"the start ({x:.2f} m north, {y:.2f} m east) is outside the domain "
            f"({domain.x_min_m:g} to {domain.x_max_m:g} m north, "
            f"{domain.y_min_m:g} to {domain.y_max_m:g} m east)"
        )
    if usable_depth_m(config, site, np.array([x]), np.array([y]))[0] >= 0.0:
        return ""
    place = f"the start ({x:.2f} m north, {y:.2f} m east)"
    for area in closed_areas(config, site):
        away = float(area.distance_m(x, y))
        if away < 0.0:
            return f"{place} is inside the keep-out {area.name}"
        if away < config.margin_m:
            return (
                f"{place} is {away:.2g} m from the keep-out {area.name}; "
                f"the margin is {config.margin_m:g} m"
            )
    if config.area is not None:
        inside_m = -float(config.area.distance_m(x, y))
        if inside_m < config.margin_m:
            where = "outside of" if inside_m < 0.0 else f"{inside_m:.2g} m from the end of"
            return f"{place} is {where} the survey area {config.area.name}"
    if site is not None and site.shore is not None:
        off_shore = -float(site.shore.distance_m(x, y))
        if 0.0 <= off_shore < config.margin_m:
            return (
                f"{place} is {off_shore:.2g} m from the shore; the margin is {config.margin_m:g} m"
            )
    return f"{place} is not in the water"


def _too_dear(config: PlannerConfig, budget: float) -> str:
    """Return which budget does not last from one surfacing to another, "" if each does."""
    least = least_spending(config)
    way = "is below the cheapest way from one surfacing to another"
    if budget < least.energy:
        return f"a budget of {budget:.3g} energy units {way}, {least.energy:.3g}"
    if 0.0 < config.time_budget_s < least.duration_s:
        return (
            f"a time budget of {config.time_budget_s:.3g} s is below the fastest way from one "
            f"surfacing to another, {least.duration_s:.3g} s"
        )
    if 0 < config.satellite_bytes < config.mission.surfacing_bytes:
        return (
            f"a satellite budget of {config.satellite_bytes} bytes is below what one surfacing "
            f"sends, {config.mission.surfacing_bytes}"
        )
    return ""


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
        f"domain, {config.max_uncertainty_m:g} m of position uncertainty, and {_budgets(config)}"
        f"{', keep-outs and shore' if config.keep_outs or config.margin_m else ''}. "
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
    """Return the result of a search that found trajectories.

    Args:
        config: Settings of the search.
        budget: Energy units of the round.
        trajectories: At least one, best first.
        progress: How the search went.
        reservoir_full: Whether some surfacing had more paths than it keeps.
    """
    best = trajectories[0]
    last = progress.best if math.isfinite(progress.best) else best.objective
    progress.history.append(ObjectivePoint(progress.elapsed_s(), last, progress.candidates))
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


def _supposed(config: PlannerConfig) -> str:
    """Return on which knowledge of the current an uncertainty rests; "" without any current."""
    std_m_s = config.position_filter.doubt * config.position_filter.steady_current_m_s
    return f" if the current is known to {100.0 * std_m_s:.2g} cm/s" if std_m_s > 0.0 else ""


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
        f"position uncertainty at most {best.worst_std_m:.2g} m{_supposed(config)}, "
        f"{_worth(config, best)}."
    )
    least = config.search.min_budget_fraction
    if spending(config, best.legs).greatest_share(config, budget) <= least:
        text = (
            f"No trajectory spends more than {least * budget:.3g} energy units"
            f"{', or as great a part of another budget' if _others(config) else ''}; "
            f"the best shorter one {text}"
        )
    elif result.status is PlanStatus.CANCELLED:
        text = f"Stopped early; the best trajectory so far {text}"
    elif result.candidates == 0:
        text = f"Nothing was searched anew: the trajectory at hand {text}"
    else:
        text = f"The best of {result.candidates:,} trajectories {text}"
    if result.reservoir_full:
        text += (
            f" Not every path was kept: the limit is {config.search.paths_per_node} a surfacing."
        )
    return text


def _others(config: PlannerConfig) -> list[str]:
    """Return which budgets are set beside that of energy."""
    named = (("time", config.time_budget_s), ("satellite bytes", config.satellite_bytes))
    return [name for name, limit in named if limit > 0]


def _budgets(config: PlannerConfig) -> str:
    return ", ".join(["energy", *_others(config)])


def _worth(config: PlannerConfig, best: Candidate) -> str:
    if config.objective == "ergodic":
        return f"ergodic measure {best.objective:.3f}"
    if config.objective == "weighted":
        return f"weighted objective {best.objective:.3f}"
    return f"{best.objective:.1f} nats of information"


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), int(_MINUTE_S))
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"
