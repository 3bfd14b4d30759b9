"""What is kept ashore of a robot's own memory, as REST says it."""

from dataclasses import dataclass
from datetime import datetime

from server.base.view import View


@dataclass(frozen=True, slots=True)
class ParameterView(View):
    """One parameter as the robot said it last."""

    name: str
    value: float
    type: str
    """``real32``, ``int32``, ``uint8`` ..."""
    is_integer: bool
    pending: bool
    """Whether it is being written now; ``value`` is then still the old one."""
    read_at: datetime


@dataclass(frozen=True, slots=True)
class ParametersView(View):
    """Every parameter of a robot, in the robot's order."""

    read_at: datetime | None
    """When the newest of them was said; ``null`` if they were never read."""
    parameters: list[ParameterView]


@dataclass(frozen=True, slots=True)
class FetchedLogView(View):
    """A copy of a file of the robot, ashore."""

    id: str
    at: datetime
    bytes: int
    sha256: str


@dataclass(frozen=True, slots=True)
class RobotLogView(View):
    """One file on board."""

    id: str
    path: str
    bytes: int
    """Its size when it was listed; a log that is still written grows."""
    modified_at: datetime | None
    """``null``: robots do not say it."""
    downloaded: FetchedLogView | None
    job: str | None = None
    """The newest job that fetches it or did, running or ended; ``null`` if there was none since the
    station began. `GET /api/jobs/{job}` says how far it is and what came of it."""


@dataclass(frozen=True, slots=True)
class RobotLogsView(View):
    """Every file that a robot says it has, or of which there is a copy."""

    read_at: datetime | None
    """When the robot listed them last."""
    logs: list[RobotLogView]
    job: str | None = None
    """The newest job that lists them or did, as that of a file."""
