"""What a tracker says of its hold on the target, in numbers that are the wire's too."""

from enum import IntEnum


class TargetPhase(IntEnum):
    """Where a robot stands with its target."""

    WAITING = 0
    """No range was heard yet; the robot waits for the first."""
    TRACKING = 1
    """Ranges come in, and the estimate agrees with them."""
    COASTING = 2
    """Ranges fail; the estimate goes on by dead reckoning and its ellipse grows."""
    LOST = 3
    """Ranges failed for too long, or contradict the estimate: the robot circles to find it."""
    ENDED = 4
    """The mission is over; the reason is in the plan's report."""


class SpeedClass(IntEnum):
    """How a target seems to swim; the number is the wire's."""

    RESTING = 0
    SLOW = 1
    FAST = 2
