"""The robot's memory of the plan on board, and of the one that waits behind it."""

from dataclasses import dataclass
from typing import Protocol

from robot_link.mission import Mission


@dataclass(frozen=True, slots=True)
class WaitingPlan:
    """A plan that waits behind the one on board for the next surfacing."""

    mission: Mission
    starts: bool
    """Whether it begins then; else it waits for START."""


class PlanStore(Protocol):
    """What the link needs of such a memory."""

    def load(self) -> Mission | None:
        """Return the plan on board, None without one."""
        ...

    def replace(self, mission: Mission) -> None:
        """Make a mission the plan on board, whole or not at all.

        Raises:
            OSError: If it cannot be kept; the one before is still on board.
        """
        ...

    def load_next(self) -> WaitingPlan | None:
        """Return the plan that waits, None without one."""
        ...

    def replace_next(self, waiting: WaitingPlan | None) -> None:
        """Make a plan the one that waits, whole or not at all; None lets none wait.

        Raises:
            OSError: If it cannot be kept; the one before still waits.
        """
        ...

    @property
    def has_queued(self) -> bool:
        """Whether a plan ever waited: then its station knows that plans can."""
        ...


class MemoryPlanStore:
    """Plans that live as long as their process."""

    def __init__(self) -> None:
        self._mission: Mission | None = None
        self._next: WaitingPlan | None = None
        self._has_queued = False

    def load(self) -> Mission | None:
        """Return the plan on board, None without one."""
        return self._mission

    def replace(self, mission: Mission) -> None:
        """Make a mission the plan on board."""
        self._mission = mission

    def load_next(self) -> WaitingPlan | None:
        """Return the plan that waits, None without one."""
        return self._next

    def replace_next(self, waiting: WaitingPlan | None) -> None:
        """Make a plan the one that waits."""
        self._next = waiting
        self._has_queued = self._has_queued or waiting is not None

    @property
    def has_queued(self) -> bool:
        """Whether a plan ever waited."""
        return self._has_queued


def resume(plans: PlanStore) -> Mission | None:
    """Return the plan on board of a robot that was switched on again.

    Whatever it flew is over. The plan that waited for that is on board now, and like every plan of
    a robot that was switched off, it waits for START.
    """
    waiting = plans.load_next()
    if waiting is not None:
        try:
            if plans.load() != waiting.mission:
                plans.replace(waiting.mission)
            plans.replace_next(None)
        except OSError:
            return plans.load()
    return plans.load()
