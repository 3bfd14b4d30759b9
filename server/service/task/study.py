"""What the tasks about vehicles are given and leave, and their names.

Like ``problem``, this loads no numba: the station imports it, the tasks' own modules do the work.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from autonomy.configuration import Configuration
from autonomy.trial.config import TrialConfig
from autonomy.vehicle.config import Vehicle

POLAR: Final = "server.service.task.vehicle_motion:polar_document"
"""Takes a ``Vehicle``, leaves the JSON document of its polar."""
STEADY: Final = "server.service.task.vehicle_motion:steady_document"
"""Takes a ``SteadyProblem``, leaves a JSON document or a ``Refusal``."""
CHECK_WHATIF: Final = "server.service.task.whatif:check"
"""Takes a ``WhatIfProblem``, leaves ``None`` or a ``Refusal``."""
WHATIF: Final = "server.service.task.whatif:run"
"""Takes a ``WhatIfProblem``, reports share and message, leaves a JSON document or a ``Refusal``."""

Document = Mapping[str, Any]
"""A JSON object."""


@dataclass(frozen=True, slots=True)
class Refusal:
    """There is no answer, for a reason that a person can do something about."""

    message: str
    loc: tuple[str | int, ...] = ()
    """Which part of what was asked is to blame."""


@dataclass(frozen=True, slots=True)
class SteadyProblem:
    """A vehicle with its actuators held still."""

    vehicle: Vehicle
    m0_kg: float
    rp1_m: float
    delta_rad: float


@dataclass(frozen=True, slots=True)
class WhatIfController:
    """A controller with its settings, and what it is called in a comparison."""

    kind: str
    title: str
    config: Configuration


@dataclass(frozen=True, slots=True)
class WhatIfProblem:
    """Controllers that are to be compared in one scenario on the same seeds."""

    vehicle: Vehicle
    scenario: TrialConfig
    controllers: tuple[WhatIfController, ...]
