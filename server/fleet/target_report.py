"""A report on a target as REST and the live stream say it."""

import math

from db.record import same
from robot_link.messages import TargetReport
from server.fleet.target_view import TargetHypothesisView, TargetReportView
from server.fleet.target_words import target_text


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
