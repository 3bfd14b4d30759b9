"""Current reports between the dialect's GRACE_CURRENT and the project's values."""

from datetime import datetime

from robot_link.current_check import checked_current, current_fault
from robot_link.mavlink.telemetry import microseconds, moment
from robot_link.mavlink.wire import grace
from robot_link.messages import RobotId
from robot_link.report import CurrentReport

CURRENT_FRAME_BYTES = 12 + grace.MAVLink_grace_current_message.unpacker.size
"""Bytes of one report's frame, at most."""
_REFUSED_MAX = 2**16 - 1


def current_message(report: CurrentReport) -> grace.MAVLink_grace_current_message:
    """Encode a possible report; more refused fixes than the field counts stop at its end."""
    north_m_s, east_m_s = report.current_ne_m_s
    return grace.MAVLink_grace_current_message(
        time_utc_us=microseconds(report.measured_at),
        north=north_m_s,
        east=east_m_s,
        std=report.current_std_m_s,
        doubt=report.doubt,
        fixes_refused=min(report.fixes_refused, _REFUSED_MAX),
        dives=report.dives,
    )


def current_report(
    message: grace.MAVLink_grace_current_message, robot: RobotId, received_at: datetime
) -> CurrentReport:
    """Decode a report.

    Raises:
        ValueError: If it says what cannot be, or its time is impossible.
    """
    return checked_current(
        CurrentReport(
            robot=robot,
            measured_at=moment(message.time_utc_us),
            received_at=received_at,
            current_ne_m_s=(message.north, message.east),
            current_std_m_s=message.std,
            doubt=message.doubt,
            dives=message.dives,
            fixes_refused=message.fixes_refused,
        )
    )


def can_travel(report: CurrentReport) -> bool:
    """Tell whether a report is possible."""
    return not current_fault(report)
