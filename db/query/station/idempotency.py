"""Answers that were given to requests with an idempotency key."""

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import delete
from sqlalchemy.orm import Session

from db.claim import Claim
from db.tables import Idempotency


@dataclass(frozen=True, slots=True)
class GivenAnswer:
    """What is known of a request that came before."""

    fingerprint: str
    """Names method, path and body, so that one key cannot stand for two requests."""
    status: int | None
    """Status of the answer, or ``None`` while it is still being worked on."""
    body: bytes
    has_acted: bool
    """Whether anything was changed for it so far."""
    made: str | None
    """Id of what it made so far."""


def claim(session: Session, of: Claim, fingerprint: str, at: datetime) -> GivenAnswer | None:
    """Claim a key for a new request, or return what is known of the one that has it."""
    row = session.get(Idempotency, (of.caller, of.request_key))
    if row is not None:
        return GivenAnswer(row.fingerprint, row.status, row.body or b"", row.has_acted, row.made)
    session.add(
        Idempotency(
            caller=of.caller,
            request_key=of.request_key,
            fingerprint=fingerprint,
            at=at,
            has_acted=False,
        )
    )
    return None


def settle(session: Session, of: Claim, status: int, body: bytes) -> None:
    """Keep the answer to the request that has claimed the key."""
    row = session.get_one(Idempotency, (of.caller, of.request_key))
    row.status = status
    row.body = body


def release(session: Session, of: Claim, *, acted_too: bool) -> None:
    """Give a key back, so that its request may be tried again.

    Args:
        session: A writing session.
        of: The key.
        acted_too: Whether also if the request has changed something.
    """
    statement = delete(Idempotency).where(
        Idempotency.caller == of.caller, Idempotency.request_key == of.request_key
    )
    if not acted_too:
        statement = statement.where(Idempotency.has_acted.is_(False))
    session.execute(statement)


def forget_before(session: Session, at: datetime) -> None:
    """Forget the answers given before a moment."""
    session.execute(delete(Idempotency).where(Idempotency.at < at))
