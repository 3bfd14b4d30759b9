"""What an identification found: as the station keeps it, and as REST shows it.

Like what it is made of, this loads no numba: the station reads results that its workers leave.
"""

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, PlainSerializer, computed_field

from autonomy.identification.recording import Reason
from autonomy.result import Known, Result
from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.parameter_file import vehicle_document, vehicle_from_document

_CONFIDENCE = 1.96
"""Standard deviations to either side that hold 95 %."""

Verdict = Literal["identified", "weak", "not identifiable", "fixed"]


class ParameterEstimate(Result):
    """One parameter before and after."""

    name: str
    title: str
    unit: str
    before: float
    after: float
    std: float | None
    """None if it is fixed or not identifiable."""
    verdict: Verdict
    reason: str

    @computed_field
    @property
    def low(self) -> float | None:
        """With ``high`` it holds 95 %."""
        return None if self.std is None else self.after - _CONFIDENCE * self.std

    @computed_field
    @property
    def high(self) -> float | None:
        """With ``low`` it holds 95 %."""
        return None if self.std is None else self.after + _CONFIDENCE * self.std


class CostPoint(Result):
    """Least cost so far after an iteration."""

    iteration: int
    cost: float


class FitChannels(Result):
    """Channels of a fit, a value for each of its moments."""

    depth_m: list[Known]
    roll_rad: list[Known]
    pitch_rad: list[Known]
    heading_rad: list[Known]


class Fit(Result):
    """Measured beside predicted at moments that are spread evenly."""

    time_s: list[float]
    segment: list[int]
    """Number of the segment of each moment: no line joins two."""
    measured: FitChannels
    before: FitChannels | None = None
    """Null if the model of before could not follow."""
    after: FitChannels


class ActuatorOffsets(Result):
    """Constant errors of the feedback that were found with the parameters and belong to them.

    They are what ``TrimConfig`` calls offsets: the parameters hold for a robot that is commanded so
    much more.
    """

    net_buoyancy_offset_kg: float
    net_buoyancy_std_kg: float | None
    mass_position_offset_m: float
    mass_position_std_m: float | None


class UsedSegment(Result):
    """A part of the recording that was held against the model."""

    start_s: float
    end_s: float
    rows: int


def _vehicle(given: object) -> object:
    return given if isinstance(given, Vehicle) else vehicle_from_document(given)


class IdentificationResult(Result):
    """The outcome of one identification."""

    method: str
    vehicle: Annotated[Vehicle, BeforeValidator(_vehicle), PlainSerializer(vehicle_document)]
    """The vehicle with the parameters that were found."""
    cost_as_is: float | None = None
    """Of the present parameters, without offsets of the actuators; null if the model of before
    could not follow the recording."""
    cost_before: float | None
    """Of the present parameters with the best offsets, if offsets were sought: what the parameters
    gained is the way from here to ``cost_after``."""
    cost_after: float
    """Mean squared residual in units of the noise, all costs of the same segments."""
    is_converged: bool = True
    """Whether the search ended at a minimum; if not there are no intervals."""
    convergence: list[CostPoint]
    """Least cost so far by iteration."""
    parameters: list[ParameterEstimate]
    offsets: ActuatorOffsets | None = None
    """Null if they were not sought."""
    findings: list[str] = Field(default_factory=list)
    """What speaks against the result, and then what the data cannot tell, worst first."""
    fit: Fit
    segments: list[UsedSegment]
    left_out: list[Reason]

    def parameter(self, name: str) -> ParameterEstimate:
        """Return the estimate of one parameter.

        Raises:
            KeyError: If there is none of that name.
        """
        for estimate in self.parameters:
            if estimate.name == name:
                return estimate
        raise KeyError(name)
