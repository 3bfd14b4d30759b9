"""Writes what a robot said of its target as CSV."""

from collections.abc import Generator

from sqlalchemy.orm import Session

from db.column import microseconds
from db.query.fleet.robots import RobotRecord
from db.query.mission.target_reports import iterate_target_reports
from db.query.mission.target_span import TargetSpan
from robot_link.report import TargetEstimate, TargetReport
from server.fleet.target_words import with_reasons

_ESTIMATES = 2
_OF_ESTIMATE = (
    "north_m", "east_m", "north_m_s", "east_m_s",
    "variance_north_m2", "covariance_m2", "variance_east_m2", "weight",
)  # fmt: skip
COLUMNS = (
    "time", "received", "phase", "robot_north_m", "robot_east_m",
    *(f"target{number}_{name}" for number in range(1, _ESTIMATES + 1) for name in _OF_ESTIMATE),
    "range_m", "range_age_s", "ranges_heard", "ranges_rejected",
    "determinant_m2_s", "barrier", "inverse_condition",
    "nominal_turn_rate_rad_s", "nominal_acceleration_m_s2", "turn_rate_rad_s", "acceleration_m_s2",
    "is_barrier_on", "is_feasible", "is_quiet", "true_north_m", "true_east_m",
    "is_too_fast", "speed_class", "delay_s",
    "reason",
)  # fmt: skip
"""Columns of the file; what is not known is left empty."""
_COMMENT = "#"
_BLOCK_ROWS = 500


def target_csv_blocks(
    session: Session, robot: RobotRecord, wanted: TargetSpan | None
) -> Generator[str]:
    """Yield a robot's reports on its target as CSV.

    Args:
        session: A reading session.
        robot: Who said it.
        wanted: Which reports; ``None`` for none.
    """
    mark = f"{_COMMENT} SIMULATION: this robot does not exist\n" if robot.simulated else ""
    site = robot.site
    yield (
        f"{mark}{_COMMENT} {robot.id}, target: times Unix s (UTC), ranges horizontal, positions in "
        f"the frame of {site.name} (origin {site.origin_latitude_deg:.7f} deg, "
        f"{site.origin_longitude_deg:.7f} deg)\n" + ",".join(COLUMNS) + "\n"
    )
    if wanted is None:
        return
    block: list[str] = []
    for told in with_reasons(session, iterate_target_reports(session, robot.id, wanted)):
        block.append(_row(*told))
        if len(block) == _BLOCK_ROWS:
            yield "".join(block)
            block = []
    yield "".join(block)


def _row(report: TargetReport, reason: str) -> str:
    estimates = [_estimate(one) for one in report.hypotheses[:_ESTIMATES]]
    estimates += [[""] * len(_OF_ESTIMATE)] * (_ESTIMATES - len(estimates))
    cells = [
        f"{microseconds(report.measured_at) / 1e6:.6f}",
        f"{microseconds(report.received_at) / 1e6:.6f}",
        report.phase.name.lower(),
        *map(repr, report.position_ne_m),
        *(cell for estimate in estimates for cell in estimate),
        "" if report.range_m is None else repr(report.range_m),
        "" if report.range_m is None else repr(report.range_age_s),
        str(report.ranges_heard),
        str(report.ranges_rejected),
        repr(report.determinant_m2_s),
        repr(report.barrier),
        repr(report.inverse_condition),
        *map(repr, (*report.nominal, *report.command)),
        *(str(int(flag)) for flag in (report.is_barrier_on, report.is_feasible, report.is_quiet)),
        *(("", "") if report.true_ne_m is None else map(repr, report.true_ne_m)),
        str(int(report.is_too_fast)),
        "" if report.speed_class is None else report.speed_class.name.lower(),
        "" if report.delay_s is None else repr(report.delay_s),
        _text(reason),
    ]
    return ",".join(cells) + "\n"


def _text(words: str) -> str:
    """Return words as a cell, which may hold commas."""
    quoted = words.replace('"', '""')
    return f'"{quoted}"' if words else ""


def _estimate(one: TargetEstimate) -> list[str]:
    return [
        repr(value)
        for value in (*one.position_ne_m, *one.velocity_ne_m_s, *one.covariance_m2, one.weight)
    ]
