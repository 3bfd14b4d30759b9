"""Actuator reports between the dialect's GRACE_ACTUATORS and the project's values."""

from datetime import datetime

from robot_link.actuator_check import checked_actuators
from robot_link.mavlink.telemetry import microseconds, moment
from robot_link.mavlink.wire import grace
from robot_link.messages import RobotId
from robot_link.report import ActuatorFollowing, ActuatorReport

ACTUATOR_FRAME_BYTES = 12 + grace.MAVLink_grace_actuators_message.unpacker.size
"""Bytes of one report's frame, at most."""
_MASS_OFF = grace.GRACE_ACTUATOR_FLAGS_MASS_OFF
_SWINGS = grace.GRACE_ACTUATOR_FLAGS_SWINGS
_STUCK = {
    "sliding mass": grace.GRACE_ACTUATOR_FLAGS_MASS_STUCK,
    "pump": grace.GRACE_ACTUATOR_FLAGS_PUMP_STUCK,
    "tail": grace.GRACE_ACTUATOR_FLAGS_TAIL_STUCK,
}
_NEVER = -1.0


def actuator_message(report: ActuatorReport) -> grace.MAVLink_grace_actuators_message:
    """Encode a possible report."""
    flags = _MASS_OFF * report.is_mass_off | _SWINGS * report.is_swinging
    for name in report.stuck:
        flags |= _STUCK[name]
    mass, pump = report.mass, report.pump
    return grace.MAVLink_grace_actuators_message(
        time_utc_us=microseconds(report.measured_at),
        mass_rate=mass.rate_share,
        mass_rate_std=mass.rate_std_octaves,
        mass_delay=mass.delay_s,
        mass_delay_std=mass.delay_std_s,
        mass_age=_NEVER if mass.learned_age_s is None else mass.learned_age_s,
        pump_rate=pump.rate_share,
        pump_rate_std=pump.rate_std_octaves,
        pump_delay=pump.delay_s,
        pump_delay_std=pump.delay_std_s,
        pump_age=_NEVER if pump.learned_age_s is None else pump.learned_age_s,
        speed_share=report.speed_share,
        flags=flags,
    )


def actuator_report(
    message: grace.MAVLink_grace_actuators_message, robot: RobotId, received_at: datetime
) -> ActuatorReport:
    """Decode a report; flags that are not known yet are left out.

    Raises:
        ValueError: If it says what cannot be, or its time is impossible.
    """
    report = ActuatorReport(
        robot=robot,
        measured_at=moment(message.time_utc_us),
        received_at=received_at,
        mass=_following(
            message.mass_rate,
            message.mass_rate_std,
            message.mass_delay,
            message.mass_delay_std,
            message.mass_age,
        ),
        pump=_following(
            message.pump_rate,
            message.pump_rate_std,
            message.pump_delay,
            message.pump_delay_std,
            message.pump_age,
        ),
        speed_share=message.speed_share,
        is_mass_off=bool(message.flags & _MASS_OFF),
        is_swinging=bool(message.flags & _SWINGS),
        stuck=tuple(name for name, flag in _STUCK.items() if message.flags & flag),
    )
    return checked_actuators(report)


def _following(
    rate: float, rate_std: float, delay: float, delay_std: float, age: float
) -> ActuatorFollowing:
    return ActuatorFollowing(rate, rate_std, delay, delay_std, None if age == _NEVER else age)
