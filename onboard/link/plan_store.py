"""The robot's memory of the plan on board."""

from typing import Protocol

from robot_link.mission import Mission


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


class MemoryPlanStore:
    """A plan that lives as long as its process."""

    def __init__(self) -> None:
        self._mission: Mission | None = None

    def load(self) -> Mission | None:
        """Return the plan on board, None without one."""
        return self._mission

    def replace(self, mission: Mission) -> None:
        """Make a mission the plan on board."""
        self._mission = mission
