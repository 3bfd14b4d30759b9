"""What is kept ashore of a robot's own memory, as REST says it."""

from dataclasses import dataclass
from datetime import datetime

from server.base.view import View


@dataclass(frozen=True, slots=True)
class ParameterChoiceView(View):
    """A value of a parameter that has a name."""

    value: float
    text: str


@dataclass(frozen=True, slots=True)
class ParameterDifference(View):
    """A parameter that a saved file and a robot do not have alike."""

    name: str
    robot: float | None
    """Its value on board, or its default; ``null`` where the robot has named none of this name."""
    file: float | None
    """``null`` where the file does not."""


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
    title: str
    """What the maker calls it; this and what follows is empty or ``null`` where nobody said it."""
    help: str
    unit: str
    default: float | None
    minimum: float | None
    maximum: float | None
    values: list[ParameterChoiceView]
    """Values that have names."""
    needs_reboot: bool
    is_default: bool | None
    """Whether it has its default; ``null`` where that is not known."""
    other: float | None
    """What the robot that it is compared with has; ``null`` where it has none, or none was asked
    for."""


@dataclass(frozen=True, slots=True)
class ParametersView(View):
    """Every parameter of a robot, in the robot's order."""

    read_at: datetime | None
    """When the newest of them was said; ``null`` if they were never read."""
    is_described: bool
    """Whether the station knows what they mean, from the vehicle itself or from a file."""
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
