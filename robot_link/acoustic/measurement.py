"""Ranges as they were measured, good and bad."""

from dataclasses import dataclass
from datetime import datetime

from robot_link.messages import RobotId


@dataclass(frozen=True, slots=True)
class RangeMeasurement:
    """The answer, or the silence, after one ping of a robot's modem."""

    robot: RobotId
    peer: int
    """Address of the robot's modem."""
    travel_time_s: float | None
    """One way; None without an answer."""
    range_m: float | None
    """Slant range, travel time by speed of sound; None without an answer."""
    at: datetime
    """When the answer came, or was given up."""
    is_valid: bool
    reason: str
    """Why it is not valid; empty when it is."""


@dataclass(frozen=True, slots=True)
class BeaconMeasurement:
    """The answers of up to four transponders of a long baseline after one ping."""

    travel_times_s: tuple[float | None, ...]
    """One way, of A to D; None for one that did not answer."""
    ranges_m: tuple[float | None, ...]
    at: datetime
    is_valid: bool
    """Whether the modem told the result; each transponder may be silent nevertheless."""
    reason: str


@dataclass(frozen=True, slots=True)
class MiniReceived:
    """A word of 13 bits from a robot's modem."""

    robot: RobotId
    peer: int
    word: int
    at: datetime
