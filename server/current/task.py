"""What the task about currents is given, and its name; this loads no numba."""

from dataclasses import dataclass
from typing import Final

from autonomy.current.config import CurrentMapConfig
from autonomy.current.model import Observation

LEARN_CURRENT: Final = "server.current.learning_task:run"
"""Takes a ``CurrentLearning``, leaves a ``CurrentMapConfig``."""


@dataclass(frozen=True, slots=True, eq=False)
class CurrentLearning:
    """Observations from which the settings of a current's map are learned."""

    config: CurrentMapConfig
    observations: tuple[Observation, ...]
    latitude_deg: float
