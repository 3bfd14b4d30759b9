"""The end of a row of the outbox: in one step with what was still to be sent of it."""

from datetime import datetime
from typing import Any

from sqlalchemy.orm import Session

from db.query import outbox as outbox_query
from db.query import satellite_messages as query
from db.query.outbox import OutboxRecord
from db.query.satellite_messages import SENDING


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
    return row
