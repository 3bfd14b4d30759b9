"""What a running identification tells, and how it is stopped and resumed."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

Checkpoint = Mapping[str, Any]
"""Everything that a later ``identify`` needs to go on exactly where this one was; JSON's types."""


@dataclass(frozen=True, slots=True)
class Progress:
    """How far an identification is."""

    iteration: int
    """Moves of the swarm and steps of the descent that are done."""
    iterations: int
    """All that are planned; a descent may end sooner."""
    best_cost: float
    """Mean squared residual in units of the measurement noise: near 1 when nothing is left."""
    spread: float
    """Mean standard deviation of the swarm's positions as a part of the box's width; 0 in the
    descent."""
    message: str
    state: Checkpoint
    """Where to resume."""


class IdentificationError(Exception):
    """An identification has no result.

    ``NothingToIdentifyError`` (problem.py): choose another recording or free a parameter.
    ``IdentificationCancelledError``: resume it from its state, or leave it.
    ``CheckpointError``: the state belongs to another recording, vehicle or configuration.
    """


class IdentificationCancelledError(IdentificationError):
    """Somebody stopped it."""

    def __init__(self, state: Checkpoint) -> None:
        super().__init__("the identification was stopped")
        self.state = state
        """Where to resume."""


class CheckpointError(IdentificationError):
    """A checkpoint does not fit to what shall be resumed."""


Report = Callable[[Progress], None]
"""Called after each iteration, in the thread that identifies."""
IsCancelled = Callable[[], bool]
"""Asked before each iteration."""
