"""Who makes a change: what a request or a command line sets, and the writer keeps with the change.

A context variable, so that nobody between a route and the event log passes it on; tasks that a
request starts have it too, and work that the station does by itself has none.
"""

from contextvars import ContextVar
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from sqlalchemy.orm import Session

_KEY = "who makes the change"


@dataclass(slots=True)
class Actor:
    """Somebody who changes something."""

    name: str
    kind: Literal["person", "script", "command line"]
    events: int = 0
    """How many events tell of what they did; only the writer's thread counts."""


acting: ContextVar[Actor | None] = ContextVar("acting", default=None)
"""Who asked for what is being done; ``None`` where the station does it by itself."""


def set_actor(session: "Session", actor: Actor | None) -> None:
    """Say for whom a session changes the database."""
    session.info[_KEY] = actor


def actor_of(session: "Session") -> Actor | None:
    """Return for whom a session changes the database."""
    return session.info.get(_KEY)
