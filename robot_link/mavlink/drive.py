"""Driving by hand: MANUAL_CONTROL of the standard, and the robot's answer to it."""

from datetime import datetime
from typing import Final

from robot_link.drive import DriveReport, Stick
from robot_link.mavlink import telemetry
from robot_link.mavlink.wire import grace
from robot_link.messages import RobotId, SystemId

SEQUENCE_BYTE: Final = 4
"""Place of a frame's number in its header (MAVLink 2); the robot's answer names it."""
_FULL: Final = 1000.0
_UNUSED: Final = 2**15 - 1
_THROTTLE_MIDDLE: Final = 500.0
"""ArduPilot's vehicles take the vertical axis as a throttle from 0 to 1000."""


def stick_message(
    system: SystemId, stick: Stick, *, has_throttle: bool
) -> grace.MAVLink_manual_control_message:
    """Encode where the stick is.

    Args:
        system: Who is driven.
        stick: Where it is held.
        has_throttle: Whether the vertical axis goes from 0 to 1000 with its middle at 500.
    """
    up = _FULL * stick.up
    return grace.MAVLink_manual_control_message(
        target=system,
        x=round(_FULL * stick.forward),
        y=0,
        z=round(_THROTTLE_MIDDLE + up / 2.0 if has_throttle else up),
        r=round(_FULL * stick.turn),
        buttons=0,
    )


def received_stick(message: grace.MAVLink_manual_control_message) -> Stick:
    """Decode where the stick is; an axis that is marked as unused is in the middle.

    Raises:
        ValueError: If an axis is beyond its range.
    """
    forward, turn, up = (
        0.0 if axis == _UNUSED else axis / _FULL for axis in (message.x, message.r, message.z)
    )
    return Stick(forward, turn, up)


def drive_message(report: DriveReport) -> grace.MAVLink_grace_drive_message:
    """Encode a robot's answer."""
    flags = (
        grace.GRACE_DRIVE_FLAGS_DRIVEN * report.is_driven
        | grace.GRACE_DRIVE_FLAGS_SILENT * report.is_silent
        | grace.GRACE_DRIVE_FLAGS_KEPT_OFF * report.is_kept_off
    )
    acts_on = report.acts_on
    return grace.MAVLink_grace_drive_message(
        time_utc_us=telemetry.microseconds(report.measured_at),
        forward=round(_FULL * acts_on.forward),
        turn=round(_FULL * acts_on.turn),
        up=round(_FULL * acts_on.up),
        sequence=report.sequence,
        flags=flags,
    )


def drive_report(
    message: grace.MAVLink_grace_drive_message, robot: RobotId, received_at: datetime
) -> DriveReport:
    """Decode a robot's answer.

    Raises:
        ValueError: If it says what cannot be.
    """
    return DriveReport(
        robot=robot,
        measured_at=telemetry.moment(message.time_utc_us),
        received_at=received_at,
        sequence=message.sequence,
        acts_on=Stick(message.forward / _FULL, message.turn / _FULL, message.up / _FULL),
        is_driven=bool(message.flags & grace.GRACE_DRIVE_FLAGS_DRIVEN),
        is_silent=bool(message.flags & grace.GRACE_DRIVE_FLAGS_SILENT),
        is_kept_off=bool(message.flags & grace.GRACE_DRIVE_FLAGS_KEPT_OFF),
    )


DRIVE_FRAME_BYTES: Final = 12 + grace.MAVLink_grace_drive_message.unpacker.size
"""Bytes of one answer's frame, at most."""
