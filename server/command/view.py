"""A command and how far it is proved."""

from dataclasses import dataclass
from datetime import datetime

from server.base.view import View


@dataclass(frozen=True, slots=True)
class LevelView(View):
    """A level that a command has reached."""

    level: str
    at: datetime
    carrier: str
    """The link that proved it; empty where the station itself did."""
    reason: str


@dataclass(frozen=True, slots=True)
class CommandView(View):
    """One command to a robot."""

    id: str
    robot: str
    kind: str
    level: str
    """``created``, ``queued``, ``radio``, ``applied``, ``refused`` or ``expired``."""
    levels: list[LevelView]
    created_at: datetime
    expires_at: datetime
    text: str
    """One sentence for the operator."""
