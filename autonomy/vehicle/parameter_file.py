"""A vehicle as a document that people write and programs exchange: every number with its unit.

Whoever reads one is told everything that is wrong with it at once, each with the entry's place,
its name and what is allowed there.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

from pydantic.fields import FieldInfo
from typing_extensions import TypedDict

from autonomy.configuration import Configuration
from autonomy.vehicle.config import SwimGait, Vehicle, VehicleParameters
from autonomy.vehicle.energy import EnergyPrices
from autonomy.vehicle.hull import Hull
from autonomy.vehicle.limits import ActuatorLimits

FORMAT = 1
"""Version of the document's layout."""

SECTIONS: dict[str, type[Configuration]] = {
    "parameters": VehicleParameters,
    "limits": ActuatorLimits,
    "swim": SwimGait,
    "hull": Hull,
    "energy": EnergyPrices,
}
"""What the document's sections hold."""

_KEY = re.compile(r"[a-z0-9][a-z0-9_-]{0,39}")
_KEY_RULE = "1 to 40 of a-z, 0-9, _ and -, beginning with a letter or digit"
_TITLE_MAX = 80
_NOTE_MAX = 500
_GREATEST = 1e9
_SMALLEST = 1e-9
"""Numbers beyond these are slips of the pen, and would overflow once they are squared."""

Location = tuple[str | int, ...]
Values = dict[str, dict[str, float]]


class Entry(TypedDict):
    """A number of a vehicle."""

    value: float
    unit: str


Section = dict[str, Entry]


class VehicleDocument(TypedDict):
    """A vehicle as people write it."""

    format: int
    key: str
    title: str
    note: str
    parameters: Section
    limits: Section
    swim: Section
    hull: Section
    energy: Section


@dataclass(frozen=True, slots=True)
class EntryError:
    """One thing wrong with a document."""

    loc: Location
    """Keys that lead to the entry."""
    message: str
    """What is wrong with it, and what would be right."""


class VehicleFileError(ValueError):
    """A document is not a vehicle; ``errors`` says everything that is wrong with it."""

    def __init__(self, errors: tuple[EntryError, ...]) -> None:
        self.errors = errors
        super().__init__(
            "; ".join(
                f"{'.'.join(map(str, one.loc)) or 'document'}: {one.message}" for one in errors
            )
        )


def vehicle_document(vehicle: Vehicle) -> VehicleDocument:
    """Return a vehicle as a document that JSON can hold; ``vehicle_from_document`` reads it."""
    return {
        "format": FORMAT,
        "key": vehicle.key,
        "title": vehicle.title,
        "note": vehicle.note,
        "parameters": _section_document(vehicle.parameters),
        "limits": _section_document(vehicle.limits),
        "swim": _section_document(vehicle.swim),
        "hull": _section_document(vehicle.hull),
        "energy": _section_document(vehicle.energy),
    }


def vehicle_from_document(given: object) -> Vehicle:
    """Read a vehicle.

    Every entry of every section is required, as ``{"value": number, "unit": text}`` with exactly
    the unit that ``vehicle_document`` writes ("" for a number without dimension).

    Args:
        given: A mapping with ``format``, ``key``, ``title``, ``note``, and the sections.

    Raises:
        VehicleFileError: With all that is wrong.
    """
    if not isinstance(given, Mapping):
        raise VehicleFileError((EntryError((), "must be an object"),))
    document = cast("Mapping[str, Any]", given)
    errors = _head_errors(document)
    values: Values = {}
    for name, model in SECTIONS.items():
        if name in document:
            values[name] = _read_section(name, model, document[name], errors)
        else:
            errors.append(EntryError((name,), f"missing; must be an object of {_count(model)}"))
    # rules about several entries mean something only once each entry alone is right
    if not errors:
        errors += _contradictions(values)
    if errors:
        raise VehicleFileError(tuple(errors))
    return Vehicle(
        key=document["key"],
        title=document["title"],
        note=document["note"],
        parameters=VehicleParameters(**values["parameters"]),
        limits=ActuatorLimits(**values["limits"]),
        swim=SwimGait(**values["swim"]),
        hull=Hull(**values["hull"]),
        energy=EnergyPrices(**values["energy"]),
    )


def _count(model: type[Configuration]) -> str:
    """Say how many entries a section has."""
    return f"{len(model.model_fields)} entries"


def allowed_range(model: type[Configuration], name: str) -> tuple[float, float]:
    """Return the smallest and the greatest value that a document may give an entry."""
    field = model.model_fields[name]
    low, high = -_GREATEST, _GREATEST
    for rule in field.metadata:
        if getattr(rule, "gt", None) is not None:
            low = max(low, rule.gt + _SMALLEST)
        if getattr(rule, "ge", None) is not None:
            low = max(low, rule.ge)
        if getattr(rule, "le", None) is not None:
            high = min(high, rule.le)
    return low, high


def _section_document(model: Configuration) -> Section:
    fields = type(model).model_fields
    return {
        name: {"value": value, "unit": _unit(fields[name])}
        for name, value in model.model_dump().items()
    }


def _unit(field: FieldInfo) -> str:
    return cast("str", cast("dict[str, Any]", field.json_schema_extra)["unit"])


def _head_errors(document: Mapping[str, Any]) -> list[EntryError]:
    """Check what stands before the sections."""
    errors = [
        EntryError(
            (name,), f"unknown; must be one of format, key, title, note, {', '.join(SECTIONS)}"
        )
        for name in document
        if name not in {"format", "key", "title", "note", *SECTIONS}
    ]
    if document.get("format") != FORMAT or isinstance(document.get("format"), bool):
        errors.append(EntryError(("format",), f"must be {FORMAT}"))
    key, title, note = (document.get(name) for name in ("key", "title", "note"))
    if not isinstance(key, str) or _KEY.fullmatch(key) is None:
        errors.append(EntryError(("key",), f"must be {_KEY_RULE}"))
    if not isinstance(title, str) or not title.strip() or len(title) > _TITLE_MAX:
        errors.append(EntryError(("title",), f"must be a text of 1 to {_TITLE_MAX} characters"))
    if not isinstance(note, str) or len(note) > _NOTE_MAX:
        errors.append(EntryError(("note",), f"must be a text of at most {_NOTE_MAX} characters"))
    return errors


def _read_section(
    section: str, model: type[Configuration], given: object, errors: list[EntryError]
) -> dict[str, float]:
    """Return the numbers of one section, and append what is wrong with it to ``errors``."""
    if not isinstance(given, Mapping):
        errors.append(EntryError((section,), f"must be an object of {_count(model)}"))
        return {}
    entries = cast("Mapping[str, object]", given)
    errors += [
        EntryError((section, name), "unknown; no such entry")
        for name in entries
        if name not in model.model_fields
    ]
    values: dict[str, float] = {}
    for name in model.model_fields:
        number = _read_entry((section, name), model, entries.get(name), errors)
        if number is not None:
            values[name] = number
    return values


def _read_entry(
    loc: tuple[str, str], model: type[Configuration], entry: object, errors: list[EntryError]
) -> float | None:
    """Return one number; None, and what is wrong in ``errors``, if it cannot be used."""
    field = model.model_fields[loc[1]]
    unit, (low, high) = _unit(field), allowed_range(model, loc[1])
    wanted = f"{field.title}: from {low:.15g} to {high:.15g} {unit}".rstrip()
    if entry is None:
        errors.append(EntryError(loc, f"missing; {wanted}"))
        return None
    if not isinstance(entry, Mapping):
        shape = f'must be {{"value": number, "unit": "{unit}"}}'
        errors.append(EntryError(loc, f"{shape}; {wanted}"))
        return None
    parts = cast("Mapping[str, object]", entry)
    found = [
        EntryError((*loc, part), f"unknown; must be value or unit; {wanted}")
        for part in parts
        if part not in {"value", "unit"}
    ]
    if "unit" not in parts:
        found.append(EntryError((*loc, "unit"), f'missing; must be "{unit}"; {wanted}'))
    elif parts["unit"] != unit:
        found.append(EntryError((*loc, "unit"), f'must be "{unit}"; {wanted}'))
    number = _number(parts.get("value"))
    if number is None or not low <= number <= high:
        problem = "missing" if "value" not in parts else "out of range or no number"
        found.append(EntryError((*loc, "value"), f"{problem}; {wanted}"))
    errors += found
    return None if found else number


def _number(given: object) -> float | None:
    """Return a finite number as a float; None for anything else, also for true and "1"."""
    if isinstance(given, bool) or not isinstance(given, int | float):
        return None
    # an integer may be too large for any float
    number = float(given) if abs(given) <= _GREATEST else math.nan
    return number if math.isfinite(number) else None


def _contradictions(values: Values) -> list[EntryError]:
    """Check the rules about several entries."""
    limits, swim, hull = values["limits"], values["swim"], values["hull"]
    errors: list[EntryError] = []
    for low, high in (("m0_min_kg", "m0_max_kg"), ("rp1_min_m", "rp1_max_m")):
        if limits[low] >= 0.0:
            errors.append(EntryError(("limits", low, "value"), "must be below 0"))
        if limits[high] <= 0.0:
            errors.append(EntryError(("limits", high, "value"), "must be above 0"))
    low, high = limits["rp1_min_m"], limits["rp1_max_m"]
    if low < 0.0 < high and not low <= swim["rp1_m"] <= high:
        text = f"must be within the sliding mass's range, {low:.15g} to {high:.15g} m"
        errors.append(EntryError(("swim", "rp1_m", "value"), text))
    rate = limits["delta_rate_rad_s"]
    greatest = rate / (2.0 * math.pi * swim["frequency_hz"])
    if swim["amplitude_rad"] > greatest:
        text = f"the tail servo follows at most {greatest:.3g} rad at this frequency"
        errors.append(EntryError(("swim", "amplitude_rad", "value"), text))
    if hull["tail_to_nose_m"] < hull["length_m"]:
        text = f"must be at least the hull's length, {hull['length_m']:.15g} m"
        errors.append(EntryError(("hull", "tail_to_nose_m", "value"), text))
    return errors
