"""What a robot that follows a target says of its hold on it."""

import math
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from db.record import same
from robot_link.report import TargetReport
from server.base.view import View, one_of
from server.fleet.target_words import target_text


@dataclass(frozen=True, slots=True)
class TargetHypothesisView(View):
    """Where the robot believes its target to be, by one hypothesis."""

    position_ne_m: tuple[float, float]
    """North and east in the site's frame."""
    velocity_ne_m_s: tuple[float, float]
    """As the robot estimates it, or was told it."""
    covariance_m2: tuple[float, float, float]
    """Of the position: north-north, north-east, east-east."""
    weight: float
    """Probability of this hypothesis, 0..1."""


@dataclass(frozen=True, slots=True)
class TargetReportView(View):
    """One report of a robot that follows a target."""

    measured_at: datetime
    received_at: datetime
    phase: Annotated[str, one_of("waiting", "tracking", "coasting", "lost", "ended")]
    """``waiting``, ``tracking``, ``coasting``, ``lost`` or ``ended``."""
    position_ne_m: tuple[float, float]
    """Where the robot believed to be itself."""
    hypotheses: list[TargetHypothesisView]
    """One or two, the likeliest first; none before the first range."""
    range_m: float | None
    """Newest horizontal range that was heard, believed or not; ``null`` before the first."""
    range_age_s: float
    """How old that range was when this was measured; of no meaning without one."""
    ranges_heard: int
    """Since the mission began."""
    ranges_rejected: int
    """Of them, those that were not believed."""
    determinant_m2_s: float
    """Determinant of the observability matrix at the estimate."""
    barrier: float
    """B by the form that the mission chose; below 0 the target is not observable enough."""
    inverse_condition: float
    """Inverse condition number of the observability matrix, 0..1."""
    nominal: tuple[float, float]
    """What the pursuit law wanted: turn rate rad/s, acceleration m/s2."""
    command: tuple[float, float]
    """What the robot asked of its tail then: turn rate rad/s, acceleration m/s2."""
    is_barrier_on: bool
    """``false`` in the teaching mode, in which nothing keeps the target observable."""
    is_feasible: bool
    """Whether the barrier could be kept."""
    is_quiet: bool
    """Whether the robot was told not to ping."""
    true_ne_m: tuple[float, float] | None
    """Where a virtual target was; ``null`` for a real one."""
    is_too_fast: bool
    """Whether the target seems too fast to follow: it will be lost."""
    speed_class: Annotated[str, one_of("resting", "slow", "fast")] | None
    """How the target seems to swim: ``resting``, ``slow`` or ``fast``; ``null`` where that is not
    estimated."""
    delay_s: float | None
    """By how much ranges seem older than they are told; ``null`` as above."""
    error_m: float | None
    """Distance of the likeliest hypothesis from the truth; ``null`` where that is not known."""
    reason: str
    """Why the mission ended, in the robot's words; empty while it goes on, and until the robot has
    said it."""
    text: str
    """What it means, in one sentence."""


@dataclass(frozen=True, slots=True)
class TargetReportsView(View):
    """Reports of one robot, the oldest first."""

    robot: str
    plan_id: str | None
    """The plan that they belong to where one was asked for; else the newest plan of kind
    ``track_target`` that the robot began, and earlier reports may be those of earlier plans;
    ``null`` where there is none."""
    reports: list[TargetReportView]


def target_view(report: TargetReport, reason: str = "") -> TargetReportView:
    """Return a report as REST says it, with why the mission ended if it has."""
    return same(
        TargetReportView,
        report,
        phase=report.phase.name.lower(),
        hypotheses=[
            TargetHypothesisView(
                one.position_ne_m, one.velocity_ne_m_s, one.covariance_m2, one.weight
            )
            for one in report.hypotheses
        ],
        speed_class=None if report.speed_class is None else report.speed_class.name.lower(),
        error_m=error_m(report),
        reason=reason,
        text=target_text(report, reason),
    )


def error_m(report: TargetReport) -> float | None:
    """Return how far the likeliest hypothesis is from the truth, where that is known."""
    if report.true_ne_m is None or not report.hypotheses:
        return None
    return math.dist(report.hypotheses[0].position_ne_m, report.true_ne_m)
