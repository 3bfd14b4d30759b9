"""What people of the station added to the catalogue of channels, or have otherwise."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import exists, or_, select
from sqlalchemy.orm import Session

from db.query.fleet.robots import robot_key
from db.query.measured.rollup import counts
from db.record import same, values
from db.sample_tables import ChannelRow, ReadingRollup, ReadingRow, SampleRollup, SampleRow
from db.tables import OwnChannel


@dataclass(frozen=True, slots=True)
class ChannelRecord:
    """One channel of the team's own, or what the station has otherwise of a delivered one."""

    key: str
    document: Mapping[str, Any]
    """Fields of the channel: all of an own one, of a delivered one those that differ."""
    is_own: bool
    retired_at: datetime | None
    changed_at: datetime
    changed_by: str


def save_channel(session: Session, record: ChannelRecord) -> None:
    """Keep a channel; what was kept under its key is replaced."""
    row = values(record, but=["document"]) | {"document": dict(record.document)}
    session.merge(OwnChannel(**row))
    session.flush()


def list_channels(session: Session) -> list[ChannelRecord]:
    """Return everything that was kept, by key."""
    rows = session.scalars(select(OwnChannel).order_by(OwnChannel.key))
    return [same(ChannelRecord, row) for row in rows]


def is_used(session: Session, key: str) -> bool:
    """Tell whether values of a channel are stored."""
    kept = select(ChannelRow.key).where(ChannelRow.name == key).scalar_subquery()
    found = (exists().where(table.channel_key == kept) for table in (SampleRollup, ReadingRollup))
    return bool(session.scalar(select(or_(*found))))


def told_counts(session: Session, robot: str) -> dict[str, int]:
    """Return how many values of each channel a robot has told, with a place or without.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = robot_key(session, robot)
    found = counts(session, SampleRow, key)
    for channel, count in counts(session, ReadingRow, key).items():
        found[channel] = found.get(channel, 0) + count
    return found
