"""Coefficients of a vehicle from a table of forces and moments."""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated

from fastapi import APIRouter, Depends, Request
from pydantic import Field, ValidationError
from starlette.datastructures import UploadFile

from autonomy.vehicle.parameter_file import VehicleDocument
from server.access.dependency import Pilot
from server.base.dependency import service
from server.base.problem import FieldError, Problem, invalid, unprocessable
from server.base.text import Title
from server.base.view import Body, View
from server.vehicle.coefficients import (
    COLUMNS,
    CoefficientTableError,
    Row,
    csv_rows,
    fit_vehicle,
    json_rows,
)
from server.vehicle.vehicles import Vehicles

router = APIRouter(prefix="/api/vehicles", tags=["vehicles"])

VehiclesDep = Annotated[Vehicles, Depends(service(Vehicles))]


class CoefficientRequest(Body):
    """A table of forces and moments."""

    rows: list[dict[str, float | None]] = Field(default_factory=list)
    """Every row with the same columns; null for a force or moment that was not measured."""
    key: str | None = Field(default=None, pattern=r"^[a-z0-9][a-z0-9_-]{0,39}$")
    """Of the vehicle in the answer."""
    title: Title | None = None
    """Of the vehicle in the answer."""
    water_density_kg_m3: float | None = Field(default=None, gt=0.0, le=1e5)
    """Of the tunnel's water; by default the vehicle's."""


@dataclass(frozen=True, slots=True)
class CoefficientView(View):
    """One coefficient of thesis Eq. 3.20."""

    name: str
    title: str
    unit: str
    before: float
    """The vehicle's own."""
    value: float
    std: float
    """Standard error."""


@dataclass(frozen=True, slots=True)
class CoefficientsView(View):
    """What a table tells of a vehicle."""

    coefficients: list[CoefficientView]
    residual: dict[str, float]
    """Root mean square of what the polynomial leaves, by column, in the column's unit."""
    kept: list[str]
    """Coefficients that the table does not tell."""
    document: VehicleDocument
    """The vehicle with them, as `POST /api/vehicles` takes it; nothing is kept yet."""


_TABLE = "; ".join(f"`{name}`: {unit}" for name, unit in COLUMNS.items())
_CONTENT = {
    "application/json": {"schema": CoefficientRequest.model_json_schema()},
    "multipart/form-data": {
        "schema": {
            "type": "object",
            "required": ["file"],
            "properties": {
                "file": {"type": "string", "format": "binary", "description": "CSV."},
                "key": {"type": "string"},
                "title": {"type": "string"},
                "water_density_kg_m3": {"type": "number"},
            },
        }
    },
}


@router.post(
    "/{key}/coefficients",
    description="Fit the coefficients of thesis Eq. 3.20 to forces and moments of a tunnel or CFD, "
    "as JSON rows or as a CSV `file`. Nothing is kept: the answer has the coefficients with "
    f"standard errors, and a vehicle to be added. Columns: {_TABLE}. At least one force or moment "
    "is needed; an empty one was not measured in its row.",
    openapi_extra={"requestBody": {"required": True, "content": _CONTENT}},
)
async def fit_coefficients(
    caller: Pilot, key: str, request: Request, vehicles: VehiclesDep
) -> CoefficientsView:
    """Fit the coefficients of a vehicle to a table."""
    del caller
    base = vehicles.get(key).vehicle
    try:
        rows, wish = await _asked(request)
        fit = partial(
            fit_vehicle,
            base,
            rows,
            key=wish.key or vehicles.free_key(f"{base.key[:30]}-tunnel"),
            title=wish.title or f"{base.title[:60]}, from a tunnel",
            water_density_kg_m3=wish.water_density_kg_m3,
        )
        found = await asyncio.to_thread(fit)
    except CoefficientTableError as error:
        raise _refusal(error) from error
    return CoefficientsView(
        coefficients=[
            CoefficientView(one.name, one.title, one.unit, one.before, one.value, one.std)
            for one in found.coefficients
        ],
        residual=dict(found.residual),
        kept=list(found.kept),
        document=found.document,
    )


async def _asked(request: Request) -> tuple[Sequence[Row], CoefficientRequest]:
    """Read a request in either form."""
    kind = request.headers.get("content-type", "").partition(";")[0].strip()
    try:
        if kind != "multipart/form-data":
            wish = CoefficientRequest.model_validate_json(await request.body())
            return json_rows(wish.rows), wish
        async with request.form() as form:
            fields = dict(form)
            file = fields.pop("file", None)
            if not isinstance(file, UploadFile):
                raise unprocessable(
                    "1 field is wrong.", [FieldError(loc=["file"], msg="must be a CSV file")]
                )
            text = (await file.read()).decode("utf-8")
            return csv_rows(text), CoefficientRequest.model_validate(fields)
    except ValidationError as error:
        raise invalid(error, CoefficientRequest) from error
    except UnicodeDecodeError as error:
        wrong = [FieldError(loc=["file"], msg="must be text in UTF-8")]
        raise unprocessable("1 field is wrong.", wrong) from error


def _refusal(error: CoefficientTableError) -> Problem:
    errors = [FieldError(loc=list(loc), msg=message) for loc, message in error.errors]
    return unprocessable(f"The table tells no coefficients: {error}.", errors)
