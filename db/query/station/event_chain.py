"""The chain of the event log: each row carries a hash of itself and of the row before it.

A row that was changed, taken out or put in between no longer fits the hashes behind it; that the
newest ones are missing shows by the head, which stands apart. Who may write all of the database may
write the chain anew: a head that was noted elsewhere tells of that (``grace audit`` prints it).
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from hashlib import sha256
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.column import microseconds
from db.tables import Event, EventHead

GENESIS = bytes(32)
"""Before the first row."""
_PAGE = 2000
_HEAD = 1


@dataclass(frozen=True, slots=True)
class ChainReport:
    """What came of a look at the whole chain."""

    rows: int
    head: str
    """Hash of the newest row that fits, hexadecimal."""
    fault: str
    """What is wrong, one sentence; "" where all fits."""


def link(session: Session, row: Event) -> None:
    """Add a row to the log and to the end of its chain; other writers wait for this transaction."""
    head = session.get(EventHead, _HEAD, with_for_update=True)
    if head is None:
        head = EventHead(key=_HEAD, rows=0, hash=GENESIS)
        session.add(head)
    row.hash = row_hash(head.hash, head.rows + 1, row)
    session.add(row)
    head.rows += 1
    head.hash = row.hash
    session.flush()


def row_hash(previous: bytes, place: int, row: Event) -> bytes:
    """Return the hash of a row: SHA-256 over the hash before it and what is hashed of it.

    Args:
        previous: Hash of the row before, 32 bytes.
        place: Of the row in the log, from 1.
        row: Its ``robot_key`` stands for the robot.
    """
    return sha256(previous + hashed_text(place, row).encode()).digest()


def hashed_text(place: int, row: Event) -> str:
    """Return what is hashed of a row, as JSON."""
    at_us = microseconds(row.at)
    told = [place, at_us, row.kind, row.level, row.robot_key, row.actor, row.actor_kind, row.text]
    return json.dumps([*told, _plain(row.data)], sort_keys=True, separators=(",", ":"))


def hashed_rows(session: Session) -> Iterator[tuple[Event, str]]:
    """Return each row with what is hashed of it, the oldest first."""
    for place, row in enumerate(_rows(session), start=1):
        yield row, hashed_text(place, row)


def look_through(session: Session, noted: str | None = None) -> ChainReport:
    """Look at every row of the log, the oldest first; stops at the first that does not fit.

    Args:
        session: Reads one unchanging moment.
        noted: A head that was noted elsewhere, hexadecimal; it must be in the chain.
    """
    head = session.get(EventHead, _HEAD)
    previous, place, has_noted = GENESIS, 0, noted is None
    for place, row in enumerate(_rows(session), start=1):
        found = row_hash(previous, place, row)
        if found != row.hash:
            fault = (
                f"event {row.cursor} ({row.at:%Y-%m-%d %H:%M:%S}Z, {row.kind}) does not follow from"
                " what is before it: it was changed, or rows before it were taken out or put in"
            )
            return ChainReport(place - 1, previous.hex(), fault)
        previous = found
        has_noted = has_noted or found.hex() == noted
    known, last = (0, GENESIS) if head is None else (head.rows, head.hash)
    fault = ""
    if place < known:
        fault = f"the newest {known - place} of {known} events are missing"
    elif (place, previous) != (known, last):
        fault = f"the head tells of {known} events and the log has {place}; one was written anew"
    elif not has_noted:
        fault = "no event has the hash that was noted: the log was written anew"
    return ChainReport(place, previous.hex(), fault)


def _rows(session: Session) -> Iterator[Event]:
    cursor = 0
    while True:
        page = session.scalars(
            select(Event).where(Event.cursor > cursor).order_by(Event.cursor).limit(_PAGE)
        ).all()
        yield from page
        if len(page) < _PAGE:
            return
        cursor = page[-1].cursor
        session.expunge_all()


def _plain(value: Any) -> Any:  # noqa: ANN401 - JSON
    """Return JSON that is the same before and after a database has kept it."""
    if isinstance(value, dict):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, float) and value.is_integer():
        return int(value)
    return value
