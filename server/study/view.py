"""Studies of vehicles: what was asked, how far they are, and what came of them."""

from datetime import datetime

from pydantic import Field

from autonomy.identification.config import IdentificationConfig
from autonomy.identification.result import CostPoint, IdentificationResult, Verdict
from autonomy.result import Result
from autonomy.vehicle.parameter_file import VehicleDocument
from autonomy.vehicle.trim import TrimAdvice
from autonomy.whatif.config import ControllerChoice, TrialConfig
from autonomy.whatif.result import ComparisonResult
from server.base.study import StudySummary, StudyView


class WhatIfAsked(Result):
    """Controllers in one scenario."""

    title: str
    """Its controllers and its reference."""
    vehicle: str
    """Key of the vehicle that it was run with."""
    scenario: TrialConfig
    """The whole scenario; see `GET /api/config/trial/schema`."""
    controllers: list[ControllerChoice]
    current_text: str = ""
    """What the current is made of that it flies in; empty for the scenario's own."""


class WhatIfSummaryView(StudySummary):
    """A what-if run in a list."""

    title: str
    vehicle: str
    shown: bool
    """Whether the 3D view draws it now."""


class WhatIfsView(Result):
    """What-if runs of a robot, the newest first."""

    whatifs: list[WhatIfSummaryView]


class WhatIfView(WhatIfAsked, StudyView):
    """One what-if run with all that was asked and what came of it."""

    notices: list[str] = Field(default_factory=list)
    """Where its reference leaves the robot's water; a run has neither walls nor floor."""
    result: ComparisonResult | None
    """Null before the end."""
    shown: bool
    """Whether the 3D view draws it now."""


class IdentificationAsked(Result):
    """A recording, and how a vehicle's parameters are sought in it."""

    deployment: str
    base_vehicle: str
    """Key of the vehicle that it began from."""
    vehicle_document: VehicleDocument
    """That vehicle as it was."""
    config: IdentificationConfig
    """The whole settings; see `GET /api/config/identification/schema`."""
    data_start_at: datetime
    """Moment of second 0 of the result."""
    data_end_at: datetime


class IdentificationNews(Result):
    """How far a search is."""

    progress: float = 0.0
    """0 to 1."""
    convergence: list[CostPoint] = Field(default_factory=list)
    """Grows while it runs."""


class IdentificationSummaryView(StudySummary):
    """An identification in a list."""

    deployment: str
    method: str
    """``swarm`` or ``least_squares``."""
    progress: float = 0.0
    """0 to 1."""
    message: str
    best_cost: float | None
    """The lowest cost so far; null before the first iteration."""
    vehicle: str | None = None
    """Key of the vehicle that it was accepted as."""


class IdentificationsView(Result):
    """Identifications of a robot, the newest first."""

    identifications: list[IdentificationSummaryView]


class IdentificationView(IdentificationAsked, IdentificationNews, StudyView):
    """One search for a vehicle's parameters in a recording."""

    vehicle_document: VehicleDocument = Field(exclude=True)
    has_checkpoint: bool
    """Whether it goes on from where it was when it is resumed, or anew."""
    result: IdentificationResult | None
    """Null before the end."""
    vehicle: str | None = None
    """Key of the vehicle that it was accepted as."""


class ActuatorOffsetView(Result):
    """Constant error of an actuator's feedback: what it reports less what is true."""

    name: str
    """As the field of ``TrimConfig``: this trim takes the error away."""
    unit: str
    value: float
    std: float | None
    """Null where the recording does not tell it."""
    verdict: Verdict

    @property
    def is_known(self) -> bool:
        """Whether the recording tells it."""
        return self.std is not None and self.verdict in {"identified", "weak"}


class AdviceAsked(Result):
    """For what a trim advice holds."""

    deployment: str
    trim_version: str
    """The version of the trim that it was worked out for, as an ``ETag``."""
    vehicle: str = ""
    """Key of the vehicle."""
    vehicle_digest: str = ""
    identification: str | None = None
    """Where it comes from, if it takes the offsets of an identified vehicle away."""


class TrimAdviceView(AdviceAsked, TrimAdvice):
    """A trim advice, to be accepted by `POST /api/robots/{robot}/trim/accept`."""

    id: str
    robot: str = Field(exclude=True)
    trim_version: str = Field(exclude=True)
    vehicle_digest: str = Field(default="", exclude=True)
    accepted_by: str | None = Field(default=None, exclude=True)


class AcceptedVehicleView(Result):
    """The vehicle that was made of an identification."""

    vehicle: str
    """Its key; `PATCH /api/robots/{robot}` with this model switches the robot to it."""
    offsets: list[ActuatorOffsetView]
    """Found together with its parameters, and part of what makes the model fit."""
    trim_advice: TrimAdviceView | None
    """Takes the offsets away; to be accepted once the robot has this model. It has no errors of
    flown glides."""
    trim_message: str
    """What the advice is about, or why there is none."""


class TrimView(Result):
    """The trim of a robot after an advice was accepted."""

    config_id: str
    """Version of the configuration ``trim``."""
    net_buoyancy_offset_kg: float
    mass_position_offset_m: float
    reaches_robot: str
    """When the robot will have it, in words."""
