"""What an identification found, as a value and as the document that is stored and shown."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.identification.identifiability import Judgement, Verdict
from autonomy.identification.problem import Problem
from autonomy.identification.recording import SegmentReport
from autonomy.identification.unknown import (
    ALWAYS_FIXED,
    GROUPS,
    MASS_POSITION_OFFSET,
    NET_BUOYANCY_OFFSET,
    parameter_title,
)
from autonomy.vehicle.config import Vehicle, VehicleParameters
from autonomy.vehicle.parameter_file import vehicle_document

_MOST_POINTS = 2000
_SHOWN = {"depth_m": 2, "roll_rad": 3, "pitch_rad": 4, "heading_rad": 5}
_CONFIDENCE = 1.96
"""Standard deviations to either side that hold 95 %."""


@dataclass(frozen=True, slots=True)
class ParameterEstimate:
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

    def document(self) -> dict[str, Any]:
        """Return it in JSON's types; ``low`` and ``high`` hold 95 %."""
        low = None if self.std is None else self.after - _CONFIDENCE * self.std
        high = None if self.std is None else self.after + _CONFIDENCE * self.std
        return {
            "name": self.name,
            "title": self.title,
            "unit": self.unit,
            "before": self.before,
            "after": self.after,
            "low": low,
            "high": high,
            "std": self.std,
            "verdict": self.verdict,
            "reason": self.reason,
        }


@dataclass(frozen=True, slots=True)
class Fit:
    """Measured beside predicted at ``k`` moments, spread evenly, by ``problem.CHANNELS``."""

    time_s: FloatArray
    """Shape ``(k,)``."""
    measured: FloatArray
    """Shape ``(k, 6)``."""
    before: FloatArray | None
    """Shape ``(k, 6)``; None if the model of before could not follow."""
    after: FloatArray
    """Shape ``(k, 6)``."""
    segment: IntArray
    """Number of the segment of each moment, shape ``(k,)``: no line joins two."""

    def document(self) -> dict[str, Any]:
        """Return it in JSON's types."""
        series = {"measured": self.measured, "before": self.before, "after": self.after}
        return {
            "time_s": self.time_s.tolist(),
            "segment": self.segment.tolist(),
            **{
                key: {
                    name: [_known(value) for value in table[:, column].tolist()]
                    for name, column in _SHOWN.items()
                }
                for key, table in series.items()
                if table is not None
            },
        }


@dataclass(frozen=True, slots=True)
class ActuatorOffsets:
    """Constant errors of the feedback that were found with the parameters and belong to them.

    They are what ``TrimConfig`` calls offsets: the parameters hold for a robot that is commanded so
    much more.
    """

    net_buoyancy_kg: float
    net_buoyancy_std_kg: float | None
    mass_position_m: float
    mass_position_std_m: float | None

    def document(self) -> dict[str, float | None]:
        """Return it in JSON's types."""
        return {
            "net_buoyancy_offset_kg": self.net_buoyancy_kg,
            "net_buoyancy_std_kg": self.net_buoyancy_std_kg,
            "mass_position_offset_m": self.mass_position_m,
            "mass_position_std_m": self.mass_position_std_m,
        }


@dataclass(frozen=True, slots=True)
class IdentificationResult:
    """The outcome of one identification."""

    method: str
    vehicle: Vehicle
    """The vehicle with the parameters that were found."""
    cost_as_is: float | None
    """Of the present parameters, without offsets of the actuators; None if the model of before
    could not follow the recording."""
    cost_before: float | None
    """Of the present parameters with the best offsets, if offsets were sought: what the parameters
    gained is the way from here to ``cost_after``."""
    cost_after: float
    """Mean squared residual in units of the noise, all costs of the same segments."""
    is_converged: bool
    """Whether the search ended at a minimum; if not there are no intervals."""
    convergence: tuple[tuple[int, float], ...]
    """Iteration and least cost so far."""
    parameters: tuple[ParameterEstimate, ...]
    offsets: "ActuatorOffsets | None"
    """None if they were not sought."""
    findings: tuple[str, ...]
    """What speaks against the result, and then what the data cannot tell, worst first."""
    fit: Fit
    report: SegmentReport

    def parameter(self, name: str) -> ParameterEstimate:
        """Return the estimate of one parameter.

        Raises:
            KeyError: If there is none of that name.
        """
        for estimate in self.parameters:
            if estimate.name == name:
                return estimate
        raise KeyError(name)

    def document(self) -> dict[str, Any]:
        """Return it in JSON's types."""
        return {
            "method": self.method,
            "cost_as_is": self.cost_as_is,
            "cost_before": self.cost_before,
            "cost_after": self.cost_after,
            "is_converged": self.is_converged,
            "convergence": [{"iteration": k, "cost": cost} for k, cost in self.convergence],
            "parameters": [estimate.document() for estimate in self.parameters],
            "offsets": None if self.offsets is None else self.offsets.document(),
            "findings": list(self.findings),
            "fit": self.fit.document(),
            "segments": [
                {"start_s": part.start_s, "end_s": part.end_s, "rows": int(part.rows.size)}
                for part in self.report.segments
            ],
            "left_out": [reason.document() for reason in self.report.left_out],
            "vehicle": vehicle_document(self.vehicle),
        }


def identified_vehicle(problem: Problem, u: FloatArray, cost: float) -> Vehicle:
    """Return the vehicle with the values of a candidate ``u``, shape ``(n,)``."""
    found = {
        unknown.name: unknown.value(float(value))
        for unknown, value in zip(problem.sought, u, strict=True)
        if unknown.index >= 0
    }
    values = problem.vehicle.parameters.model_dump() | found
    report = problem.report
    note = (
        f"identified from {report.duration_s:.0f} s of flight in {len(report.segments)} segments,"
        f" cost {cost:.2f}"
    )
    if problem.config.fits_offsets:
        offset_kg, offset_m = _offset_values(problem, u)
        note += (
            f"; belongs with a trim of {offset_kg * 1e3:+.2f} g and {offset_m * 1e3:+.2f} mm, which"
            " were found with it"
        )
    return replace(problem.vehicle, parameters=VehicleParameters(**values), note=note)


def _offset_values(problem: Problem, u: FloatArray) -> tuple[float, float]:
    found = {
        unknown.name: unknown.value(float(value))
        for unknown, value in zip(problem.sought, u, strict=True)
    }
    return found.get(NET_BUOYANCY_OFFSET, 0.0), found.get(MASS_POSITION_OFFSET, 0.0)


def offsets_of(
    problem: Problem, u: FloatArray, judged: tuple[Judgement, ...]
) -> ActuatorOffsets | None:
    """Return the actuators' offsets of a candidate ``u``, shape ``(n,)``, if they were sought."""
    std = {
        unknown.name: judgement.std * unknown.scale if math.isfinite(judgement.std) else None
        for unknown, judgement in zip(problem.sought, judged, strict=True)
    }
    if NET_BUOYANCY_OFFSET not in std:
        return None
    offset_kg, offset_m = _offset_values(problem, u)
    return ActuatorOffsets(offset_kg, std[NET_BUOYANCY_OFFSET], offset_m, std[MASS_POSITION_OFFSET])


def estimates(
    problem: Problem, u: FloatArray, judged: tuple[Judgement, ...]
) -> tuple[ParameterEstimate, ...]:
    """Return one estimate for each parameter of the table and each offset, in the table's order.

    ``u`` is the candidate, shape ``(n,)``.
    """
    found = {
        unknown.name: ParameterEstimate(
            unknown.name,
            unknown.title,
            unknown.unit,
            unknown.nominal,
            unknown.value(float(value)),
            judgement.std * unknown.scale if math.isfinite(judgement.std) else None,
            judgement.verdict,
            judgement.reason,
        )
        for unknown, value, judgement in zip(problem.sought, u, judged, strict=True)
    }
    table = {name for names in GROUPS.values() for name in names} | ALWAYS_FIXED.keys()
    rows: list[ParameterEstimate] = []
    for name, value in problem.vehicle.parameters.model_dump().items():
        if name in found:
            rows.append(found[name])
        elif name in table:
            title, unit = parameter_title(name)
            kept = "is 0: no range to search" if value == 0.0 else "held fixed by the settings"
            reason = ALWAYS_FIXED.get(name, kept)
            rows.append(ParameterEstimate(name, title, unit, value, value, None, "fixed", reason))
    offsets = (NET_BUOYANCY_OFFSET, MASS_POSITION_OFFSET)
    return (*rows, *(found[name] for name in offsets if name in found))


def fit_of(problem: Problem, before: FloatArray | None, after: FloatArray) -> Fit:
    """Thin measured and predicted rows to what a plot shows.

    Args:
        problem: The fit.
        before: Predicted by the parameters of before, shape ``(rows, 6)``, or None.
        after: Predicted by those that were found, shape ``(rows, 6)``.
    """
    layout = problem.layout
    every = max(math.ceil(layout.time_s.size / _MOST_POINTS), 1)
    part = np.arange(0, layout.time_s.size, every)
    segment = np.searchsorted(layout.segment_row, part, side="right") - 1
    return Fit(
        layout.time_s[part],
        layout.measured[part],
        None if before is None else before[part],
        after[part],
        segment.astype(np.int64),
    )


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
