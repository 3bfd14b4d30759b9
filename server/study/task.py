"""What the tasks about vehicles are given and leave, and their names.

Like ``problem``, this loads no numba: the station imports it, the tasks' own modules do the work.
"""

from dataclasses import dataclass
from typing import Final

from autonomy.current.table import FlowTable
from autonomy.identification.config import IdentificationConfig
from autonomy.identification.recording import Recording
from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.trim import TrimConfig
from autonomy.whatif.config import ControllerChoice, TrialConfig
from server.base.study import Document

CHECK_WHATIF: Final = "server.study.whatif_task:check"
"""Takes a ``WhatIfProblem``, leaves ``None`` or a ``Refusal``."""
WHATIF: Final = "server.study.whatif_task:run"
"""Takes a ``WhatIfProblem``, reports share and message, leaves a ``ComparisonResult`` or a
``Refusal``."""
IDENTIFY: Final = "server.study.identification_task:run"
"""Takes an ``IdentificationProblem``, reports ``SearchNews``, leaves an
``IdentificationResult`` or a ``Refusal``."""
ADVISE_TRIM: Final = "server.study.trim_task:run"
"""Takes a ``TrimProblem``, leaves a ``TrimAdvice`` or a ``Refusal``."""

CHECKPOINT: Final = ("resume",)
"""Place of a refusal to go on from a checkpoint: it does not fit the recording as it is now."""


@dataclass(frozen=True, slots=True)
class WhatIfProblem:
    """Controllers that are to be compared in one scenario on the same seeds."""

    vehicle: Vehicle
    scenario: TrialConfig
    controllers: tuple[ControllerChoice, ...]
    flow: FlowTable | None = None
    """The current from where the run begins; that of the scenario by default."""


@dataclass(frozen=True, slots=True)
class IdentificationProblem:
    """A recording in which a vehicle's parameters are sought."""

    vehicle: Vehicle
    recording: Recording
    config: IdentificationConfig
    resume: Document | None
    """Checkpoint of an earlier run that is to go on."""


@dataclass(frozen=True, slots=True)
class SearchNews:
    """How far an identification is."""

    iteration: int
    iterations: int
    best_cost: float
    spread: float
    message: str
    checkpoint: Document | None
    """Where to go on from; not with every iteration, for it is large."""


@dataclass(frozen=True, slots=True)
class TrimProblem:
    """The last dives of a robot, and the trim that it has."""

    vehicle: Vehicle
    recording: Recording
    present: TrimConfig
    dives: int
    """How many of the last dives count."""
