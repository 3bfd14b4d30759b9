"""A robot driven by hand: what the pilot's stick says, and what the robot answers to it."""

from dataclasses import dataclass
from datetime import datetime

from robot_link.messages import RobotId

SILENCE_S = 0.5
"""A robot of ours that hears no stick for so long stops its tail; seconds of its own clock."""
RELEASE_S = 10.0
"""After so long without a stick nobody drives it any more."""


@dataclass(frozen=True, slots=True)
class Stick:
    """Where the pilot holds the stick; each axis -1 to 1, 0 in the middle."""

    forward: float = 0.0
    """Ahead is positive."""
    turn: float = 0.0
    """To starboard is positive."""
    up: float = 0.0
    """Upward is positive."""

    def __post_init__(self) -> None:
        """Refuse what is no stick's place.

        Raises:
            ValueError: If an axis is not a number in -1..1.
        """
        for axis in (self.forward, self.turn, self.up):
            if not -1.0 <= axis <= 1.0:
                raise ValueError(f"an axis of a stick is -1 to 1, not {axis:g}")


CENTRE = Stick()


@dataclass(frozen=True, slots=True)
class DriveReport:
    """What a robot that is driven says of itself, at once for each stick that it took."""

    robot: RobotId
    measured_at: datetime
    received_at: datetime
    sequence: int
    """Number of the newest stick's frame on the wire, 0..255."""
    acts_on: Stick
    """What it acts on: the stick, but for what it holds back."""
    is_driven: bool
    is_silent: bool
    """Whether it stopped because it hears no stick."""
    is_kept_off: bool
    """Whether it does not swim on because a wall or the shore is ahead."""
