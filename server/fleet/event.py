"""What the fleet tells the other capabilities."""

from dataclasses import dataclass
from datetime import datetime

from db.query.fleet.robots import RobotRecord
from robot_link.messages import RobotId


@dataclass(frozen=True, slots=True)
class RobotChanged:
    """A robot was added, or what is written of it was changed."""

    record: RobotRecord


@dataclass(frozen=True, slots=True)
class SigningChanged:
    """A robot's radio is signed with another key from now on, or no more."""

    robot: RobotId


@dataclass(frozen=True, slots=True)
class RobotReported:
    """What is known of a robot changed: it said something, or something was found out about it."""

    robot: str


@dataclass(frozen=True, slots=True)
class FixTaken:
    """A robot reported that it has a position fix; the report is on its way to the database."""

    robot: RobotId
    at: datetime


@dataclass(frozen=True, slots=True)
class TrackGrew:
    """A robot moved far enough for another point of its track."""

    robot: str


@dataclass(frozen=True, slots=True)
class LinkSwitched:
    """The operator enabled or disabled a link, for every robot that shares its port."""

    uri: str
    is_enabled: bool
