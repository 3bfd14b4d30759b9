"""What holds for a robot's satellite link and what it has spent."""

from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final

from sqlalchemy.orm import Session

from db.query.satellite.outbox import OutboxRecord, newest_outbox
from db.query.satellite.satellite_messages import SENDING, messages_in
from robot_link.satellite.config import RoutingConfig, SatelliteConfig
from server.base.configuration import current
from server.base.configuration_kind import find_kind
from server.satellite.budget import Budget, budget_of, utc_day
from server.satellite.row_kind import RowKinds

_FORGOTTEN: Final = timedelta(hours=24)
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
    until: datetime
    """When time alone may change it."""


def settings_of(session: Session, robot: str | None) -> Settings:
    """Return the settings that hold for a robot."""
    return Settings(
        current(session, find_kind("satellite"), robot).value_as(SatelliteConfig),
        current(session, find_kind("link"), robot).value_as(RoutingConfig),
    )


def account_of(session: Session, kinds: RowKinds, robot: str, now: datetime) -> Account:
    """Return the account of a robot as it is now."""
    settings = settings_of(session, robot)
    waiting = [
        message.text
        for message in messages_in(session, SENDING)
        if message.robot == robot and message.attempts - (message.retry_at is None) >= _PATIENCE
    ]
    newest = [newest_outbox(session, robot, name) for name in kinds.names]
    ended = [row for row in newest if row is not None and row.ended_at is not None]
    faults = {fault: row for row in ended if (fault := _fault(kinds, row, now))}
    forgotten = [row.ended_at + _FORGOTTEN for row in faults.values() if row.ended_at]
    return Account(
        settings,
        budget_of(session, robot, settings.satellite.tariff, now),
        (waiting[-1] if waiting else "") or next(iter(faults), ""),
        min([utc_day(now)[1], *forgotten]),
    )


def _fault(kinds: RowKinds, row: OutboxRecord, now: datetime) -> str:
    if row.state not in ("refused", "expired") or row.ended_at is None:
        return ""
    if now - row.ended_at >= _FORGOTTEN:
        return ""
    subject = kinds.of(row).fault_of(row)
    return f"{subject} {row.state}: {row.reason.rstrip('.')}." if subject else ""
