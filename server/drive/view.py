"""What a pilot's page says, and what it is told."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from pydantic import Field

from server.base.view import Body, View, one_of

Axis = Annotated[float, Field(ge=-1.0, le=1.0, allow_inf_nan=False)]


class StickBody(Body):
    """Where the pilot holds the stick now; sent ten to twenty times a second while they drive."""

    n: Annotated[int, Field(ge=0, le=2**31 - 1)]
    """Number of the stick; the answer to it names it."""
    forward: Axis = 0.0
    """Ahead is positive."""
    turn: Axis = 0.0
    """To starboard is positive."""
    up: Axis = 0.0
    """Upward is positive."""


@dataclass(frozen=True, slots=True)
class StickView(View):
    """Where a stick is; each axis -1 to 1."""

    forward: float
    turn: float
    up: float


@dataclass(frozen=True, slots=True)
class RobotAnswerView(View):
    """What a robot answered to a stick; vehicles of other makers do not answer."""

    n: int
    """Number of the stick that is answered."""
    age_s: float
    acts_on: StickView
    """What it acts on: the stick, but for what it holds back."""
    is_silent: bool
    """Whether it stopped because it heard no stick."""
    is_kept_off: bool
    """Whether it turns away from a wall or the shore that is ahead."""


@dataclass(frozen=True, slots=True)
class DriveView(View):
    """How a robot is driven by hand; also what the pilot's WebSocket tells."""

    robot: str
    state: Annotated[str, one_of("free", "beginning", "driving", "ended")]
    """``free`` where nobody drives it; ``ended`` is the last word to its pilot."""
    driver: str
    """Who drives it; empty for nobody of this station."""
    begun_at: datetime | None
    reason: str
    """Why it was refused or has ended, one sentence; of a free robot why nobody can begin now."""
    has_depth: bool
    """Whether the vertical axis does something: not where radio ends at the surface."""
    answers: int
    """How many sticks were answered within the last 10 s."""
    p50_ms: float | None
    """Half of those answers came within this, from the station's sending to their arrival."""
    p95_ms: float | None
    newest: RobotAnswerView | None
    dropped: int
    """Sticks that were not sent because a newer one was there before the radio was free."""


def refused(robot: str, reason: str) -> DriveView:
    """Return the last word to somebody who may not drive."""
    return DriveView(robot, "ended", "", None, reason, False, 0, None, None, None, 0)
