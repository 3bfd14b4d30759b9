"""What the tasks about vehicles are given and leave, and their names.

Like ``problem``, this loads no numba: the station imports it, the tasks' own modules do the work.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from autonomy.configuration import Configuration
from autonomy.identification.config import IdentificationConfig
from autonomy.identification.recording import Recording
from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.trim import TrimConfig
from autonomy.whatif.config import TrialConfig

POLAR: Final = "server.vehicle.motion_task:polar_document"
"""Takes a ``Vehicle``, leaves the JSON document of its polar."""
STEADY: Final = "server.vehicle.motion_task:steady_document"
"""Takes a ``SteadyProblem``, leaves a JSON document or a ``Refusal``."""
CHECK_WHATIF: Final = "server.study.whatif_task:check"
"""Takes a ``WhatIfProblem``, leaves ``None`` or a ``Refusal``."""
WHATIF: Final = "server.study.whatif_task:run"
"""Takes a ``WhatIfProblem``, reports share and message, leaves a JSON document or a ``Refusal``."""
IDENTIFY: Final = "server.study.identification_task:run"
"""Takes an ``IdentificationProblem``, reports ``IdentificationNews``, leaves a JSON document or a
``Refusal``."""
ADVISE_TRIM: Final = "server.study.trim_task:run"
"""Takes a ``TrimProblem``, leaves a JSON document or a ``Refusal``."""

Document = Mapping[str, Any]
"""A JSON object."""

CHECKPOINT: Final = ("resume",)
"""Place of a refusal to go on from a checkpoint: it does not fit the recording as it is now."""


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


@dataclass(frozen=True, slots=True)
class IdentificationProblem:
    """A recording in which a vehicle's parameters are sought."""

    vehicle: Vehicle
    recording: Recording
    config: IdentificationConfig
    resume: Document | None
    """Checkpoint of an earlier run that is to go on."""


@dataclass(frozen=True, slots=True)
class IdentificationNews:
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
