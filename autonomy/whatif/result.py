"""What a comparison of controllers leaves: SI units, angles in rad; free of compiled code.

A number that is not finite is null, and all are rounded, for there are many.
"""

from typing import Annotated

from pydantic import BeforeValidator

from autonomy.result import Result, known


def _rounded(value: float | None) -> float | None:
    found = known(value)
    return None if found is None else round(float(found), 9)


Value = Annotated[float | None, BeforeValidator(_rounded)]
Values = list[Value]


class Track(Result):
    """Where a robot is, at the moments of the comparison."""

    north_m: Values
    east_m: Values
    depth_m: Values
    pitch_rad: Values


class TrackErrors(Result):
    """Medians over the seeds at each moment."""

    depth_m: Values
    horizontal_m: Values
    pitch_rad: Values
    hybrid_rad: Values


class Band(Result):
    """Limits between which 90 % of the runs are, at each moment."""

    low: Values
    high: Values


class ErrorBands(Result):
    """Bands of the errors that have one."""

    depth_m: Band
    horizontal_m: Band
    pitch_rad: Band


class Inputs(Result):
    """Where the actuators were."""

    m0_kg: Values
    rp1_m: Values
    delta_rad: Values


class Travel(Result):
    """Way of each actuator."""

    m0_kg: Value
    rp1_m: Value
    delta_rad: Value


class RunSummary(Result):
    """Medians over the seeds."""

    depth_rms_m: Value
    horizontal_rms_m: Value
    horizontal_end_m: Value
    pitch_rms_rad: Value
    hybrid_rms_rad: Value
    travel: Travel
    energy_j: Value


class ComparedRun(Track):
    """One controller; track and inputs are those of the run with the median horizontal error."""

    kind: str
    title: str
    errors: TrackErrors
    band: ErrorBands
    inputs: Inputs
    summary: RunSummary


class ComparisonResult(Result):
    """Controllers side by side on the same seeds."""

    time_s: Values
    reference: Track
    runs: list[ComparedRun]
    seeds: list[int]
    vehicle: str
    note: str
    """What to know of the vehicle's model."""
