"""What a request with an idempotency key has changed, kept in the transaction of the change.

A station that is killed between a commit and its answer can then tell a repeated request what the
first one made, and lets one that changed nothing be carried out.
"""

from contextvars import ContextVar
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sqlalchemy import func, update

from db.tables import Idempotency

if TYPE_CHECKING:
    from sqlalchemy.orm import Session

_MADE = "what the transaction made"


@dataclass(slots=True)
class Claim:
    """A key that is claimed by a request which is not answered yet."""

    caller: str
    request_key: str
    is_open: bool = True
    """Until the answer is kept; tasks that the request started change nothing for it later."""


claimed: ContextVar[Claim | None] = ContextVar("claimed", default=None)
"""The claim of the request for which something is done."""


def note_made(session: "Session", identity: str) -> None:
    """Say what a transaction makes; the first thing that is said counts."""
    session.info.setdefault(_MADE, identity)


def keep_claim(session: "Session", claim: Claim | None) -> None:
    """Write with a change that the request behind it has acted, and what it made first."""
    if claim is None or not claim.is_open:
        return
    made = session.info.get(_MADE)
    session.execute(
        update(Idempotency)
        .where(Idempotency.caller == claim.caller, Idempotency.request_key == claim.request_key)
        .values(has_acted=True, made=func.coalesce(Idempotency.made, made))
    )
