"""Track reports between the dialect's GRACE_TRACK and the project's values."""

import struct
from datetime import datetime

from autonomy.tracking.phase import SpeedClass
from robot_link.mavlink.telemetry import check_finite, microseconds, moment
from robot_link.mavlink.wire import grace
from robot_link.messages import RobotId
from robot_link.report import TargetEstimate, TargetReport
from robot_link.target_check import MOST_HYPOTHESES, checked_target, target_phase

TARGET_FRAME_BYTES = 12 + grace.MAVLink_grace_track_message.unpacker.size
"""Bytes of one report's frame, at most."""

_NOBODY = TargetEstimate((0.0, 0.0), (0.0, 0.0), (0.0, 0.0, 0.0), 0.0)
_HAS_RANGE = grace.GRACE_TRACK_FLAGS_HAS_RANGE
_BARRIER_ON = grace.GRACE_TRACK_FLAGS_BARRIER_ON
_FEASIBLE = grace.GRACE_TRACK_FLAGS_FEASIBLE
_QUIET = grace.GRACE_TRACK_FLAGS_QUIET
_HAS_TRUTH = grace.GRACE_TRACK_FLAGS_HAS_TRUTH
_TOO_FAST = grace.GRACE_TRACK_FLAGS_TOO_FAST
_FLAGS = _HAS_RANGE | _BARRIER_ON | _FEASIBLE | _QUIET | _HAS_TRUTH | _TOO_FAST


def target_message(report: TargetReport) -> grace.MAVLink_grace_track_message:
    """Encode a report as float32; a third hypothesis and later ones do not travel."""
    known = report.hypotheses[:MOST_HYPOTHESES]
    told = (*known, *(_NOBODY,) * (MOST_HYPOTHESES - len(known)))
    true_x, true_y = report.true_ne_m or (0.0, 0.0)
    return grace.MAVLink_grace_track_message(
        time_utc_us=microseconds(report.measured_at),
        x=report.position_ne_m[0],
        y=report.position_ne_m[1],
        target_x=[one.position_ne_m[0] for one in told],
        target_y=[one.position_ne_m[1] for one in told],
        target_vx=[one.velocity_ne_m_s[0] for one in told],
        target_vy=[one.velocity_ne_m_s[1] for one in told],
        covariance_xx=[one.covariance_m2[0] for one in told],
        covariance_xy=[one.covariance_m2[1] for one in told],
        covariance_yy=[one.covariance_m2[2] for one in told],
        weight=[one.weight for one in told],
        range=report.range_m or 0.0,
        range_age=0.0 if report.range_m is None else report.range_age_s,
        determinant=report.determinant_m2_s,
        barrier=report.barrier,
        inverse_condition=report.inverse_condition,
        nominal_turn_rate=report.nominal[0],
        nominal_acceleration=report.nominal[1],
        turn_rate=report.command[0],
        acceleration=report.command[1],
        true_x=true_x,
        true_y=true_y,
        ranges_heard=report.ranges_heard,
        ranges_rejected=report.ranges_rejected,
        phase=int(report.phase),
        hypotheses=len(known),
        flags=_flags(report),
        delay=report.delay_s or 0.0,
        speed_class=0 if report.speed_class is None else report.speed_class + 1,
    )


def target_report(
    message: grace.MAVLink_grace_track_message, robot: RobotId, received_at: datetime
) -> TargetReport:
    """Decode a report.

    Raises:
        ValueError: If a number is not finite or impossible, or the phase, the time or a flag is
            unknown.
    """
    if message.hypotheses > MOST_HYPOTHESES or message.flags & ~_FLAGS:
        raise ValueError("hypotheses or flags of a track are unknown")
    hypotheses = tuple(_hypothesis(message, index) for index in range(message.hypotheses))
    flags = message.flags
    check_finite((message.range, message.true_x, message.true_y))
    return checked_target(
        TargetReport(
            robot=robot,
            measured_at=moment(message.time_utc_us),
            received_at=received_at,
            phase=target_phase(message.phase),
            position_ne_m=(message.x, message.y),
            hypotheses=hypotheses,
            range_m=message.range if flags & _HAS_RANGE else None,
            range_age_s=message.range_age if flags & _HAS_RANGE else 0.0,
            ranges_heard=message.ranges_heard,
            ranges_rejected=message.ranges_rejected,
            determinant_m2_s=message.determinant,
            barrier=message.barrier,
            inverse_condition=message.inverse_condition,
            nominal=(message.nominal_turn_rate, message.nominal_acceleration),
            command=(message.turn_rate, message.acceleration),
            is_barrier_on=bool(flags & _BARRIER_ON),
            is_feasible=bool(flags & _FEASIBLE),
            is_quiet=bool(flags & _QUIET),
            true_ne_m=(message.true_x, message.true_y) if flags & _HAS_TRUTH else None,
            is_too_fast=bool(flags & _TOO_FAST),
            speed_class=_speed_class(message.speed_class),
            delay_s=message.delay if message.speed_class else None,
        )
    )


def can_travel(report: TargetReport) -> bool:
    """Tell whether a report is possible, and each of its numbers fits its field."""
    try:
        checked_target(report)
        target_message(report).pack(grace.MAVLink(None))
    except (ValueError, ArithmeticError, struct.error, grace.MAVError):
        return False
    return True


def _hypothesis(message: grace.MAVLink_grace_track_message, index: int) -> TargetEstimate:
    return TargetEstimate(
        position_ne_m=(message.target_x[index], message.target_y[index]),
        velocity_ne_m_s=(message.target_vx[index], message.target_vy[index]),
        covariance_m2=(
            message.covariance_xx[index],
            message.covariance_xy[index],
            message.covariance_yy[index],
        ),
        weight=message.weight[index],
    )


def _speed_class(number: int) -> SpeedClass | None:
    if number > len(SpeedClass):
        raise ValueError(f"speed class {number} of a target is unknown")
    return SpeedClass(number - 1) if number else None


def _flags(report: TargetReport) -> int:
    return (
        _HAS_RANGE * (report.range_m is not None)
        | _BARRIER_ON * report.is_barrier_on
        | _FEASIBLE * report.is_feasible
        | _QUIET * report.is_quiet
        | _HAS_TRUTH * (report.true_ne_m is not None)
        | _TOO_FAST * report.is_too_fast
    )
