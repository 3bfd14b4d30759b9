"""What holds for each robot's satellite link and what it has spent, read anew once a second."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final

from sqlalchemy.orm import Session

from db.query.outbox import OutboxRecord, newest_outbox
from db.query.satellite_messages import SENDING, messages_in
from robot_link.satellite.config import RoutingConfig, SatelliteConfig
from server.base.configuration import current
from server.base.configuration_kind import find_kind
from server.satellite.budget import Budget, budget_of
from server.satellite.row_kind import RowKinds

_REMEMBERED: Final = timedelta(hours=24)
"""A plan that was refused or expired concerns the operator this long."""
_PATIENCE: Final = 2
"""Attempts that may find no gateway before a person is told."""


@dataclass(frozen=True, slots=True)
class Settings:
    """What holds for one robot."""

    satellite: SatelliteConfig
    routing: RoutingConfig


DEFAULT_SETTINGS: Final = Settings(SatelliteConfig(), RoutingConfig())


@dataclass(frozen=True, slots=True)
class Account:
    """What the database says of one robot's satellite link."""

    settings: Settings
    budget: Budget
    fault: str


def settings_of(session: Session, robot: str | None) -> Settings:
    """Return the settings that hold for a robot."""
    return Settings(
        current(session, find_kind("satellite"), robot).value_as(SatelliteConfig),
        current(session, find_kind("link"), robot).value_as(RoutingConfig),
    )


def accounts(
    session: Session, kinds: RowKinds, robots: Iterable[str], now: datetime
) -> Mapping[str, Account]:
    """Return the accounts of these robots."""
    waiting = {
        message.robot: message.text
        for message in messages_in(session, SENDING)
        if message.attempts - (message.retry_at is None) >= _PATIENCE
    }
    found: dict[str, Account] = {}
    for robot in robots:
        settings = settings_of(session, robot)
        newest = [newest_outbox(session, robot, name) for name in kinds.names]
        faults = [_fault(kinds, row, now) for row in newest if row is not None]
        found[robot] = Account(
            settings,
            budget_of(session, robot, settings.satellite.tariff, now),
            waiting.get(robot) or next((one for one in faults if one), ""),
        )
    return found


def _fault(kinds: RowKinds, row: OutboxRecord, now: datetime) -> str:
    if row.state not in ("refused", "expired") or row.ended_at is None:
        return ""
    if now - row.ended_at > _REMEMBERED:
        return ""
    subject = kinds.of(row).fault_of(row)
    return f"{subject} {row.state}: {row.reason.rstrip('.')}." if subject else ""
