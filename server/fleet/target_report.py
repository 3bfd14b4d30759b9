"""A report on a target as REST and the live stream say it."""

import math

from robot_link.messages import TargetReport
from server.fleet.target_view import TargetHypothesisView, TargetReportView
from server.fleet.target_words import target_text


def target_view(report: TargetReport, reason: str = "") -> TargetReportView:
    """Return a report as REST says it, with why the mission ended if it has."""
    return TargetReportView(
        measured_at=report.measured_at,
        received_at=report.received_at,
        phase=report.phase.name.lower(),
        position_ne_m=report.position_ne_m,
        hypotheses=[
            TargetHypothesisView(
                one.position_ne_m, one.velocity_ne_m_s, one.covariance_m2, one.weight
            )
            for one in report.hypotheses
        ],
        range_m=report.range_m,
        range_age_s=report.range_age_s,
        ranges_heard=report.ranges_heard,
        ranges_rejected=report.ranges_rejected,
        determinant_m2_s=report.determinant_m2_s,
        barrier=report.barrier,
        inverse_condition=report.inverse_condition,
        nominal=report.nominal,
        command=report.command,
        is_barrier_on=report.is_barrier_on,
        is_feasible=report.is_feasible,
        is_quiet=report.is_quiet,
        true_ne_m=report.true_ne_m,
        error_m=error_m(report),
        reason=reason,
        text=target_text(report, reason),
    )


def error_m(report: TargetReport) -> float | None:
    """Return how far the likeliest hypothesis is from the truth, where that is known."""
    if report.true_ne_m is None or not report.hypotheses:
        return None
    return math.dist(report.hypotheses[0].position_ne_m, report.true_ne_m)
