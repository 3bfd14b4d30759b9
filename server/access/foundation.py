"""What every service and route of one station stands on."""

from dataclasses import dataclass

from db.store import Store
from robot_link.clock import Clock
from server.access.access import Access
from server.access.guard import Guard
from server.base.alarm_board import AlarmBoard
from server.base.background import Background
from server.base.configuration import ConfigurationBook
from server.base.event_bus import EventBus
from server.base.job import JobBoard
from server.base.secret import SecretStore
from server.base.settings import Settings


@dataclass(frozen=True, slots=True)
class Foundation:
    """The shared parts of one station, opened in this order and closed in reverse."""

    settings: Settings
    clock: Clock
    """Time of the robots: events, plans and measurements. A demo's runs faster than the wall."""
    store: Store
    bus: EventBus
    """What happened, told after it was committed."""
    access: Access
    guard: Guard
    background: Background
    alarms: AlarmBoard
    jobs: JobBoard
    configurations: ConfigurationBook
    secrets: SecretStore
    """Keys of robots and accounts with gateways; what it holds is shown to nobody."""
