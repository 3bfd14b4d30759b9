"""Fixes by cameras between the dialect's GRACE_FIX and the project's values.

What another laboratory's motion capture sends, VISION_POSITION_ESTIMATE, becomes the same value.
"""

import math
from datetime import timedelta
from typing import Final

from robot_link.camera.fix import CameraFix
from robot_link.camera.received_fix import ReceivedFix
from robot_link.mavlink.telemetry import microseconds, moment
from robot_link.mavlink.wire import grace
from robot_link.messages import SystemId

FIX_FRAME_BYTES: Final = 12 + grace.MAVLink_grace_fix_message.unpacker.size
"""Bytes of one fix's frame; its last byte is a system id and never zero, so none is shorter."""
FixMessage = grace.MAVLink_grace_fix_message | grace.MAVLink_vision_position_estimate_message

_ANGLE: Final = 1e-4
_RMS: Final = 1e-2
_UINT16_MAX: Final = 2**16 - 1
_UINT8_MAX: Final = 2**8 - 1
_HEADING: Final = grace.GRACE_FIX_FLAGS_HEADING
_TILT: Final = grace.GRACE_FIX_FLAGS_TILT
_XX, _XY, _YY, _ZZ, _ROLL, _PITCH, _YAW = 0, 1, 6, 11, 15, 18, 20
"""Places in the upper right triangle of a 6 x 6 covariance, row by row."""


def fix_message(
    fix: CameraFix, system: SystemId, clock_offset_s: float
) -> grace.MAVLink_grace_fix_message:
    """Encode a fix for the robot that it shows; deviations stop at the end of their field.

    Args:
        fix: One that was not refused.
        system: The robot.
        clock_offset_s: The robot's time minus the station's.

    Raises:
        ValueError: If the fix was refused, or says what no robot may take.
    """
    if fix.quality == "refused":
        raise ValueError(f"the fix was refused: {fix.reason}")
    xx, xy, _, yy, _, zz = fix.covariance_m2
    has_tilt = fix.roll_rad is not None and fix.pitch_rad is not None
    message = grace.MAVLink_grace_fix_message(
        time_utc_us=microseconds(fix.measured_at + timedelta(seconds=clock_offset_s)),
        x=fix.ned_m[0],
        y=fix.ned_m[1],
        z=fix.ned_m[2],
        covariance_xx=xx,
        covariance_xy=xy,
        covariance_yy=yy,
        covariance_zz=zz,
        heading=_angle(fix.heading_rad),
        heading_std=_unsigned(fix.heading_std_rad / _ANGLE, fix.heading_rad is not None),
        roll=_angle(fix.roll_rad),
        pitch=_angle(fix.pitch_rad),
        tilt_std=_unsigned(fix.tilt_std_rad / _ANGLE, has_tilt),
        residual=_unsigned(fix.rms / _RMS),
        cameras=min(len(fix.cameras), _UINT8_MAX),
        tags=min(len(fix.tags), _UINT8_MAX),
        flags=_HEADING * (fix.heading_rad is not None) | _TILT * has_tilt,
        target_system=system,
    )
    received_fix(message)
    return message


def received_fix(message: FixMessage) -> ReceivedFix:
    """Decode a fix.

    Args:
        message: A time since boot, which VISION_POSITION_ESTIMATE may carry, is a moment in 1970
            and so too old for whoever takes fixes.

    Raises:
        ValueError: If the time is impossible, a flag unknown, a number not finite, the covariance
            untold or not positive definite, or a standard deviation beyond 1 m.
    """
    if isinstance(message, grace.MAVLink_grace_fix_message):
        return _camera_fix(message)
    return _motion_capture_fix(message)


def _camera_fix(message: grace.MAVLink_grace_fix_message) -> ReceivedFix:
    flags = message.flags
    if flags & ~(_HEADING | _TILT):
        raise ValueError("a flag of the fix is unknown")
    has_tilt = bool(flags & _TILT)
    return ReceivedFix(
        measured_at=moment(message.time_utc_us),
        ned_m=(message.x, message.y, message.z),
        covariance_ne_m2=(message.covariance_xx, message.covariance_xy, message.covariance_yy),
        depth_variance_m2=message.covariance_zz,
        heading_rad=message.heading * _ANGLE if flags & _HEADING else None,
        heading_std_rad=message.heading_std * _ANGLE,
        roll_rad=message.roll * _ANGLE if has_tilt else None,
        pitch_rad=message.pitch * _ANGLE if has_tilt else None,
        tilt_std_rad=message.tilt_std * _ANGLE,
        rms=message.residual * _RMS,
        cameras=message.cameras,
        tags=message.tags,
    )


def _motion_capture_fix(message: grace.MAVLink_vision_position_estimate_message) -> ReceivedFix:
    told = message.covariance
    has_heading = told[_YAW] > 0.0 and math.isfinite(message.yaw)
    has_tilt = min(told[_ROLL], told[_PITCH]) > 0.0
    return ReceivedFix(
        measured_at=moment(message.usec),
        ned_m=(message.x, message.y, message.z),
        covariance_ne_m2=(told[_XX], told[_XY], told[_YY]),
        depth_variance_m2=told[_ZZ],
        heading_rad=math.remainder(message.yaw, math.tau) if has_heading else None,
        heading_std_rad=math.sqrt(told[_YAW]) if has_heading else 0.0,
        roll_rad=message.roll if has_tilt else None,
        pitch_rad=message.pitch if has_tilt else None,
        tilt_std_rad=math.sqrt(max(told[_ROLL], told[_PITCH])) if has_tilt else 0.0,
        rms=0.0,
        cameras=0,
        tags=0,
    )


def _angle(angle_rad: float | None) -> int:
    """Return an angle as the wire says it, in -pi .. pi; 0 where there is none."""
    if angle_rad is None:
        return 0
    if not math.isfinite(angle_rad):
        raise ValueError("an angle of the fix is not finite")
    return round(math.remainder(angle_rad, math.tau) / _ANGLE)


def _unsigned(value: float, is_told: bool = True) -> int:
    """Return a number as an unsigned field says it; 0 where it is not told."""
    if not is_told:
        return 0
    if not value >= 0.0:
        raise ValueError("a deviation of the fix is negative or not a number")
    return _UINT16_MAX if value > _UINT16_MAX else round(value)
