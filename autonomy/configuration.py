"""What every tunable model is made of: closed, frozen, and self-describing fields.

The JSON Schema of a model is what the operator's forms are generated from, so a field says its
title, unit, bounds and help exactly once, here in ``autonomy``.
"""

from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from autonomy.described import Described


class Configuration(Described, BaseModel):
    """Base of every tunable model: unknown keys, infinities and later changes are refused."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        allow_inf_nan=False,
        json_schema_serialization_defaults_required=True,
    )


def quantity(
    default: Any,  # noqa: ANN401 - a pydantic default has the field's own type
    unit: str = "",
    *,
    title: str,
    ge: float | None = None,
    gt: float | None = None,
    le: float | None = None,
    lt: float | None = None,
    display_unit: str | None = None,
    advanced: bool = False,
) -> Any:  # noqa: ANN401 - stands where pydantic's own Field stands
    """Declare one tunable quantity; its help text is the docstring below the field.

    Args:
        default: Value when nobody says otherwise.
        unit: SI unit of the stored value, "" where it has none.
        title: Label of the field in a form.
        ge: Smallest allowed value.
        gt: Value that must be exceeded.
        le: Largest allowed value.
        lt: Value that must not be reached.
        display_unit: Unit on the screen where it differs ("deg" for a value in rad).
        advanced: Hide behind "Advanced" in the form.

    Returns:
        A pydantic field whose schema carries ``unit``, ``display_unit`` and ``advanced``.
    """
    extra: dict[str, Any] = {"unit": unit, "advanced": advanced}
    if display_unit is not None:
        extra["display_unit"] = display_unit
    return Field(default=default, title=title, ge=ge, gt=gt, le=le, lt=lt, json_schema_extra=extra)
