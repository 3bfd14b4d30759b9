"""Coefficients of a vehicle from a table of forces and moments, measured in a tunnel or by CFD."""

import csv
import io
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.identification.polynomial import (
    TERMS,
    Coefficient,
    PolynomialFit,
    TableError,
    fit_polynomials,
)
from autonomy.identification.unknown import parameter_title
from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.parameter_file import (
    VehicleDocument,
    VehicleFileError,
    vehicle_document,
    vehicle_from_document,
)

COLUMNS: Mapping[str, str] = MappingProxyType(
    {
        "speed_m_s": "m/s, of the flow",
        "alpha_deg": "degrees, angle of attack, positive nose up (or alpha_rad, in radians)",
        "beta_deg": "degrees, sideslip, positive flow from starboard (or beta_rad)",
        "delta_deg": "degrees, tail (or delta_rad)",
        "drag_n": "N, against the flow",
        "side_force_n": "N, positive to starboard",
        "lift_n": "N, positive up",
        "roll_moment_n_m": "N m, about the flow's direction",
        "pitch_moment_n_m": "N m, positive nose up",
        "yaw_moment_n_m": "N m, positive to starboard",
    }
)
"""Columns of a table and their units; at least one force or moment is needed."""

ROWS_MAX = 100_000
_ERRORS_MAX = 20
_SURPLUS = "surplus cells"
_ANGLES = ("alpha", "beta", "delta")
Location = tuple[str | int, ...]
Row = tuple[Location, Mapping[str, object]]


class CoefficientTableError(ValueError):
    """A table tells no coefficients; ``errors`` names places and what is wrong there."""

    def __init__(self, errors: Sequence[tuple[Location, str]]) -> None:
        super().__init__("; ".join(f"{place_of(loc)}: {message}" for loc, message in errors))
        self.errors = tuple(errors)


@dataclass(frozen=True, slots=True)
class FittedCoefficient:
    """One coefficient of thesis Eq. 3.20."""

    name: str
    title: str
    unit: str
    before: float
    """What the vehicle has that the table was held against."""
    value: float
    std: float
    """Standard error from the scatter about the polynomial."""


@dataclass(frozen=True, slots=True)
class FittedVehicle:
    """A vehicle with the coefficients that a table tells."""

    coefficients: tuple[FittedCoefficient, ...]
    residual: Mapping[str, float]
    """Root mean square of what the polynomial leaves, by column, in the column's unit."""
    kept: tuple[str, ...]
    """Coefficients that the table does not tell; the vehicle keeps its own."""
    document: VehicleDocument
    """The vehicle as `POST /api/vehicles` takes it."""


def place_of(loc: Location) -> str:
    """Return a place in a table as people say it."""
    return " ".join(str(part) for part in loc)


def csv_rows(text: str) -> list[Row]:
    """Return the rows of a CSV table with their lines.

    Raises:
        CoefficientTableError: If there is no table.
    """
    lines = io.StringIO(text.removeprefix("\ufeff"))
    reader = csv.DictReader(lines, skipinitialspace=True, restkey=_SURPLUS)
    if not reader.fieldnames:
        raise CoefficientTableError([(("line", 1), f"needs columns: {', '.join(COLUMNS)}")])
    reader.fieldnames = [name.strip() for name in reader.fieldnames]
    return [(("line", reader.line_num), dict(row)) for row in reader]


def json_rows(rows: Iterable[Mapping[str, object]]) -> list[Row]:
    """Return rows with their numbers, from 0."""
    return [(("rows", number), row) for number, row in enumerate(rows)]


def fit_vehicle(
    base: Vehicle,
    rows: Sequence[Row],
    *,
    key: str,
    title: str,
    water_density_kg_m3: float | None = None,
) -> FittedVehicle:
    """Fit the coefficients of thesis Eq. 3.20 to a table.

    An empty force or moment was not measured in its row. What the table does not tell, such as
    the damping of turns, stays as the vehicle has it.

    Args:
        base: The vehicle whose coefficients are sought; its area is what they refer to.
        rows: The table, see ``COLUMNS``.
        key: Of the vehicle to make.
        title: Of the vehicle to make.
        water_density_kg_m3: Of the tunnel's water, by default the vehicle's.

    Raises:
        CoefficientTableError: With everything that is wrong with the table, or with the vehicle
            that would come of it.
    """
    density = water_density_kg_m3 or base.parameters.water_density_kg_m3
    fit = _fitted(_columns(rows), density, base.parameters.area_m2)
    told = ", ".join(sorted(fit.residual))
    note = f"coefficients of Eq. 3.20 from {len(rows)} rows of {told}; the rest of {base.key}"
    vehicle = replace(
        base,
        key=key,
        title=title,
        note=note,
        parameters=base.parameters.model_copy(update=fit.values),
    )
    document = vehicle_document(vehicle)
    try:
        vehicle_from_document(json.loads(json.dumps(document)))
    except VehicleFileError as error:
        raise CoefficientTableError([(one.loc, one.message) for one in error.errors]) from error
    return FittedVehicle(
        tuple(_with_title(one, base) for one in fit.coefficients),
        fit.residual,
        tuple(term[0] for terms in TERMS.values() for term in terms if term[0] not in fit.values),
        document,
    )


def _with_title(found: Coefficient, base: Vehicle) -> FittedCoefficient:
    title, unit = parameter_title(found.name)
    before = getattr(base.parameters, found.name)
    return FittedCoefficient(found.name, title, unit, before, found.value, found.std)


def _columns(rows: Sequence[Row]) -> dict[str, FloatArray]:
    """Return the columns in SI units, NaN where a force or moment was not measured."""
    if not 0 < len(rows) <= ROWS_MAX:
        message = f"needs rows, at most {ROWS_MAX:,}; has {len(rows):,}"
        raise CoefficientTableError([(("table",), message)])
    names = list(dict.fromkeys(name for _, row in rows for name in row))
    errors: list[tuple[Location, str]] = []
    columns = {name: np.full(len(rows), math.nan) for name in names}
    for number, (loc, row) in enumerate(rows):
        for name in names:
            try:
                columns[name][number] = _number(row.get(name), is_needed=name not in TERMS)
            except ValueError as error:
                errors.append(((*loc, name), str(error)))
        if len(errors) >= _ERRORS_MAX:
            break
    for angle in _ANGLES:
        degrees, radians = f"{angle}_deg", f"{angle}_rad"
        if degrees in columns and radians in columns:
            errors.append(((degrees,), f"is there beside {radians}; leave one out"))
        elif degrees in columns:
            columns[radians] = np.radians(columns.pop(degrees))
    if errors:
        raise CoefficientTableError(errors)
    return columns


def _number(given: object, *, is_needed: bool) -> float:
    if given is None or given == "":
        if is_needed:
            raise ValueError("is empty")
        return math.nan
    number = math.nan
    if isinstance(given, int | float | str) and not isinstance(given, bool):
        with suppress(ValueError, OverflowError):
            number = float(given)
    if not math.isfinite(number):
        raise ValueError(f"{given!r} is no finite number")
    return number


def _fitted(columns: Mapping[str, FloatArray], density: float, area_m2: float) -> PolynomialFit:
    """Fit each force or moment to the rows in which it was measured."""
    conditions = {name: values for name, values in columns.items() if name not in TERMS}
    measured = [name for name in TERMS if name in columns]
    coefficients: list[Coefficient] = []
    residual: dict[str, float] = {}
    errors: dict[tuple[str, str], None] = {}
    for name in measured or [""]:
        known = np.isfinite(columns[name]) if name else slice(None)
        table = {one: values[known] for one, values in conditions.items()}
        if name:
            table[name] = columns[name][known]
        try:
            found = fit_polynomials(table, density, area_m2)
        except TableError as error:
            errors |= dict.fromkeys(error.errors)
        else:
            coefficients += found.coefficients
            residual |= found.residual
    if errors:
        raise CoefficientTableError([((column,), message) for column, message in errors])
    return PolynomialFit(tuple(coefficients), residual)
