"""Identifications and trim advice."""

from dataclasses import dataclass
from datetime import datetime
from typing import Any

from server.base.view import View


@dataclass(frozen=True, slots=True)
class IdentificationSummaryView(View):
    """An identification in a list."""

    id: str
    deployment: str
    state: str
    """``running``, ``done``, ``failed``, ``cancelled`` or ``interrupted``."""
    method: str
    """``swarm`` or ``least_squares``."""
    progress: float
    """0 to 1."""
    message: str
    best_cost: float | None
    """The lowest cost so far; null before the first iteration."""
    vehicle: str | None
    """Key of the vehicle that it was accepted as."""
    job: str | None
    created_at: datetime
    created_by: str


@dataclass(frozen=True, slots=True)
class IdentificationsView(View):
    """Identifications of a robot, the newest first."""

    identifications: list[IdentificationSummaryView]


@dataclass(frozen=True, slots=True)
class ConvergenceView(View):
    """Best cost after an iteration."""

    iteration: int
    cost: float


@dataclass(frozen=True, slots=True)
class IdentificationView(View):
    """One search for a vehicle's parameters in a recording."""

    id: str
    robot: str
    deployment: str
    state: str
    """``running``, ``done``, ``failed``, ``cancelled`` or ``interrupted``; the last three can be
    resumed."""
    base_vehicle: str
    """Key of the vehicle that it began from."""
    config: dict[str, Any]
    """The whole settings; see `GET /api/config/identification/schema`."""
    data_start_at: datetime
    """Moment of second 0 of the result."""
    data_end_at: datetime
    progress: float
    """0 to 1."""
    message: str
    convergence: list[ConvergenceView]
    """Grows while it runs."""
    has_checkpoint: bool
    """Whether it goes on from where it was when it is resumed, or anew."""
    result: dict[str, Any] | None
    """Costs, parameters with their verdicts, the fit, and what was left out; null before the
    end."""
    vehicle: str | None
    """Key of the vehicle that it was accepted as."""
    job: str | None
    created_at: datetime
    created_by: str
    ended_at: datetime | None


@dataclass(frozen=True, slots=True)
class ActuatorOffsetView(View):
    """Constant error of an actuator's feedback: what it reports less what is true."""

    name: str
    """``net_buoyancy_offset_kg`` or ``mass_position_offset_m``."""
    unit: str
    value: float
    std: float | None
    """Null where the recording does not tell it."""
    verdict: str


@dataclass(frozen=True, slots=True)
class AcceptedVehicleView(View):
    """The vehicle that was made of an identification."""

    vehicle: str
    """Its key; `PATCH /api/robots/{robot}` with this model switches the robot to it."""
    offsets: list[ActuatorOffsetView]
    """Found together with its parameters, and part of what makes the model fit."""
    trim_advice: dict[str, Any] | None
    """Takes the offsets away; to be accepted by `POST /api/robots/{robot}/trim/accept` once the
    robot has this model. Shaped like every advice, but without errors of flown glides."""
    trim_message: str
    """What the advice is about, or why there is none."""


@dataclass(frozen=True, slots=True)
class AdviceJobView(View):
    """Where to wait for a trim advice."""

    job: str
    """Its result is the advice, with the id by which it is accepted."""


@dataclass(frozen=True, slots=True)
class TrimView(View):
    """The trim of a robot after an advice was accepted."""

    config_id: str
    """Version of the configuration ``trim``."""
    net_buoyancy_offset_kg: float
    mass_position_offset_m: float
    reaches_robot: str
    """When the robot will have it, in words."""
