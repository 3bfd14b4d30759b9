"""A fix by cameras: where a robot was, and how surely, as the station found it."""

from dataclasses import dataclass
from datetime import datetime
from typing import Literal

from robot_link.messages import RobotId

FixQuality = Literal["good", "position_only", "refused"]


@dataclass(frozen=True, slots=True)
class CameraFix:
    """One fix of one robot, taken or refused."""

    robot: RobotId
    measured_at: datetime
    """When the pictures were taken, by the station's clock."""
    ned_m: tuple[float, float, float]
    """North, east, and depth below the real surface, as a pressure sensor counts it."""
    covariance_m2: tuple[float, float, float, float, float, float]
    """Of ``ned_m``: xx, xy, xz, yy, yz, zz."""
    considered_covariance_m2: tuple[float, float, float, float, float, float]
    """The part of it that does not average out; no filter may claim less."""
    heading_rad: float | None
    """From north of the tank's frame, clockwise; none where only the position is sure."""
    heading_std_rad: float
    roll_rad: float | None
    pitch_rad: float | None
    tilt_std_rad: float
    cameras: tuple[str, ...]
    tags: tuple[int, ...]
    rms: float
    """Root mean square residual of the corners, in standard deviations."""
    quality: FixQuality
    reason: str
    """Why it is less than good; empty where it is good."""
    calibration: int | None
    """Key of the calibration that it rests on."""
