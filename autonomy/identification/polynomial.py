"""Coefficients of thesis Eq. 3.20 from tables of forces and moments in a water tunnel."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray

_ANGLES = ("alpha_rad", "beta_rad", "delta_rad")
_SPEED = "speed_m_s"
_STEEPEST_RAD = math.pi / 2.0

TERMS: dict[str, tuple[tuple[str, str, int], ...]] = {
    "drag_n": (
        ("drag_0", "", 0),
        ("drag_alpha", "alpha_rad", 2),
        ("drag_delta", "delta_rad", 2),
    ),
    "side_force_n": (("side_beta", "beta_rad", 1), ("side_delta", "delta_rad", 1)),
    "lift_n": (("lift_0", "", 0), ("lift_alpha", "alpha_rad", 1)),
    "roll_moment_n_m": (("roll_beta_m", "beta_rad", 1),),
    "pitch_moment_n_m": (("pitch_0_m", "", 0), ("pitch_alpha_m", "alpha_rad", 1)),
    "yaw_moment_n_m": (("yaw_beta_m", "beta_rad", 1), ("yaw_delta_m", "delta_rad", 1)),
}
"""For each measured column the parameters of ``VehicleParameters`` that it tells, with the angle
and the power that each multiplies. A robot at rest in a tunnel does not turn, so it says nothing of
the three damping coefficients."""


class TableError(ValueError):
    """A table cannot be used; ``errors`` names every column that is wrong and why."""

    def __init__(self, errors: Sequence[tuple[str, str]]) -> None:
        super().__init__("; ".join(f"{column}: {message}" for column, message in errors))
        self.errors = tuple(errors)
        """Column and message."""


@dataclass(frozen=True, slots=True)
class Coefficient:
    """One coefficient of Eq. 3.20."""

    name: str
    """Field of ``VehicleParameters``."""
    value: float
    std: float
    """Standard error from the scatter about the polynomial."""


@dataclass(frozen=True, slots=True)
class PolynomialFit:
    """What the tables tell."""

    coefficients: tuple[Coefficient, ...]
    residual: Mapping[str, float]
    """Root mean square of what the polynomial leaves, by column, in the column's unit."""

    @property
    def values(self) -> dict[str, float]:
        """Values by name, to be put into ``VehicleParameters``."""
        return {coefficient.name: coefficient.value for coefficient in self.coefficients}


def fit_polynomials(
    table: Mapping[str, Sequence[float] | FloatArray], water_density_kg_m3: float, area_m2: float
) -> PolynomialFit:
    """Fit Eq. 3.20 to forces and moments at rest in flowing water.

    Args:
        table: Columns of equal length: ``speed_m_s``, ``alpha_rad``, ``beta_rad``, ``delta_rad``,
            and at least one of the columns of ``TERMS``, in the flow's frame (drag against the
            flow, lift up). The thesis varies one angle at a time; any mixture will do.
        water_density_kg_m3: Of the tunnel's water.
        area_m2: Area that the coefficients refer to.

    Raises:
        TableError: If a column is missing, unknown, of another length, not finite or out of range,
            or if its angles do not vary enough to tell its coefficients apart.

    Source:
        Coleman, thesis, Eq. 3.4 and 3.20.
    """
    columns = _checked(table)
    pressure = 0.5 * water_density_kg_m3 * area_m2 * columns[_SPEED] ** 2
    found: list[Coefficient] = []
    residual: dict[str, float] = {}
    errors: list[tuple[str, str]] = []
    for name in (name for name in TERMS if name in columns):
        design = pressure[:, None] * _powers(columns, name)
        scaled = design / np.maximum(np.linalg.norm(design, axis=0), 1e-300)
        count = design.shape[1]
        if design.shape[0] <= count or np.linalg.matrix_rank(scaled, tol=1e-6) < count:
            told = ", ".join(term[0] for term in TERMS[name])
            errors.append((name, f"the angles vary too little to tell {told}"))
            continue
        value, std, left = _solved(design, columns[name])
        residual[name] = left
        found += [
            Coefficient(term[0], float(v), float(s))
            for term, v, s in zip(TERMS[name], value, std, strict=True)
        ]
    if errors:
        raise TableError(errors)
    return PolynomialFit(tuple(found), residual)


def _checked(table: Mapping[str, Sequence[float] | FloatArray]) -> dict[str, FloatArray]:
    """Return the columns as arrays, or refuse them all at once."""
    errors: list[tuple[str, str]] = []
    needed = (_SPEED, *_ANGLES)
    errors += [(name, "is missing") for name in needed if name not in table]
    known = {*needed, *TERMS}
    listed = ", ".join(TERMS)
    errors += [
        (name, f"is unknown; the columns are {', '.join(needed)}, {listed}")
        for name in table
        if name not in known
    ]
    if not any(name in table for name in TERMS):
        errors.append(("table", f"needs at least one of {listed}"))
    columns = {
        name: np.asarray(values, dtype=np.float64)
        for name, values in table.items()
        if name in known
    }
    rows = columns[_SPEED].size if _SPEED in columns else None
    for name, values in columns.items():
        errors += [(name, flaw) for flaw in _flaws(name, values, rows)]
    if errors:
        raise TableError(errors)
    return columns


def _flaws(name: str, values: FloatArray, rows: int | None) -> list[str]:
    if values.ndim != 1 or (rows is not None and values.size != rows):
        return [f"has {values.size} values where {rows} are needed"]
    if not np.isfinite(values).all():
        return [f"is not a number in row {int(np.flatnonzero(~np.isfinite(values))[0]) + 1}"]
    if name == _SPEED and not (values > 0.0).all():
        return ["must be greater than 0 m/s"]
    if name in _ANGLES and (np.abs(values) > _STEEPEST_RAD).any():
        worst = float(np.max(np.abs(values)))
        return [f"reaches {worst:.3g}: must be within ±{_STEEPEST_RAD:.3f} rad; is it in degrees?"]
    return []


def _powers(columns: Mapping[str, FloatArray], name: str) -> FloatArray:
    """Return what each coefficient of a column multiplies, shape ``(rows, terms)``."""
    ones = np.ones_like(columns[_SPEED])
    return np.column_stack(
        [columns[angle] ** power if angle else ones for _, angle, power in TERMS[name]]
    )


def _solved(design: FloatArray, measured: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Return coefficients, their standard errors, and the root mean square of what is left."""
    q, r = np.linalg.qr(design)
    value = np.asarray(np.linalg.solve(r, q.T @ measured), dtype=np.float64)
    left = measured - design @ value
    variance = float(left @ left) / (design.shape[0] - design.shape[1])
    inverse = np.linalg.inv(r)
    std = np.asarray(np.sqrt(variance * np.sum(inverse**2, axis=1)), dtype=np.float64)
    return value, std, math.sqrt(float(np.mean(left**2)))
