"""Rows of the outbox that begin and end, each told once it is committed, whoever did it.

The end is one step with what was still to be sent.
"""

from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy.orm import Session

from db.query.satellite import outbox as outbox_query
from db.query.satellite import satellite_messages as query
from db.query.satellite.outbox import OutboxRecord
from db.query.satellite.satellite_messages import SENDING
from db.writer import tell_after_commit


@dataclass(frozen=True, slots=True)
class RowsChanged:
    """Something on its way to a robot began, goes on or ended; told after the commit."""

    robot: str


def told(session: Session, row: OutboxRecord) -> OutboxRecord:
    """Have it told that a row was added, opened or ended; return the row."""
    tell_after_commit(session, RowsChanged(row.robot), row.robot)
    return row


def end_row(
    session: Session,
    outbox: str,
    state: str,
    reason: str,
    at: datetime,
    **changes: Any,  # noqa: ANN401 - the fields differ in type
) -> OutboxRecord:
    """End a row; nothing more of it is sent, and what a gateway may have is not called back.

    Args:
        session: The transaction that proves or decides the end.
        outbox: Which row.
        state: How it ended.
        reason: Why, for the operator.
        at: When.
        changes: What else changes of the row.
    """
    row = outbox_query.change_outbox(
        session, outbox, state=state, reason=reason, ended_at=at, **changes
    )
    for message in query.messages_of(session, outbox):
        if message.state == SENDING:
            was_tried = message.attempts > 0
            query.change_message(
                session,
                message.id,
                state="unknown" if was_tried else "dropped",
                retry_at=None,
                text="Not sent again; nobody knows whether the gateway has it."
                if was_tried
                else "Not sent.",
            )
    return told(session, row)
