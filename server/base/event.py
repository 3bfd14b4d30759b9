"""What the shared parts of a station tell its capabilities."""

from dataclasses import dataclass

from db.query.alarms import AlarmRecord
from db.query.events import EventRecord
from db.query.jobs import JobRecord


@dataclass(frozen=True, slots=True)
class SettingsChanged:
    """A new version of tunable settings was saved."""

    kind: str
    robot: str | None
    """Whose; ``None`` for every robot that has none of its own."""


@dataclass(frozen=True, slots=True)
class JobChanged:
    """A job began, got further or ended."""

    job: JobRecord


@dataclass(frozen=True, slots=True)
class AlarmChanged:
    """An alarm was raised, changed, acknowledged or closed."""

    alarm: AlarmRecord


@dataclass(frozen=True, slots=True)
class EventLogged:
    """The event log has a new row, of this process or of another such as the command line."""

    event: EventRecord
