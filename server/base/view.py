"""Parents of views and of request bodies, and what views say of documents and words."""

from enum import IntEnum
from typing import Annotated, Any

import msgspec
from fastapi import Response
from pydantic import (
    BaseModel,
    ConfigDict,
    GetCoreSchemaHandler,
    RootModel,
    TypeAdapter,
    WithJsonSchema,
)
from pydantic_core import CoreSchema
from typing_extensions import TypeAliasType

from autonomy.channel import ALARM_LEVELS
from autonomy.described import Described

CURSOR_MAX = 2**63 - 1
"""Largest key of a database."""


_SCHEMAS: dict[type, CoreSchema] = {}
_BEING_READ: set[type] = set()


class View(Described):
    """Lets the docstring below a field become its description in the OpenAPI schema.

    A field with a default is always sent, so the schema requires it.
    """

    __slots__ = ()
    __pydantic_config__ = ConfigDict(json_schema_serialization_defaults_required=True)

    @classmethod
    def __get_pydantic_core_schema__(
        cls, source: type, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Describe a view once for all routes that have it."""
        if source not in _SCHEMAS:
            if source in _BEING_READ:
                return handler(source)
            _BEING_READ.add(source)
            try:
                _SCHEMAS[source] = TypeAdapter(source).core_schema
            finally:
                _BEING_READ.discard(source)
        return _SCHEMAS[source]


def encoded(view: object) -> Response:
    """Return a large view as JSON at once; its route declares the schema as ``response_model``."""
    if isinstance(view, BaseModel):
        return Response(view.model_dump_json(), media_type="application/json")
    return Response(msgspec.json.encode(view), media_type="application/json")


class Body(Described, BaseModel):
    """A closed body: an unknown field is an error, so that a typo is not silently ignored."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def one_of(*words: str) -> WithJsonSchema:
    """Return what makes the schema of a text name the words that it can be."""
    return WithJsonSchema({"type": "string", "enum": list(words)})


def name_of(words: type[IntEnum]) -> WithJsonSchema:
    """Return what makes the schema of a text name the members of an enumeration, in small."""
    return one_of(*(word.name.lower() for word in words))


def numbers(count: int) -> WithJsonSchema:
    """Return what makes the schema of a list of numbers tell how many there are."""
    items = [{"type": "number"}] * count
    return WithJsonSchema(
        {"type": "array", "prefixItems": items, "minItems": count, "maxItems": count}
    )


def _json_object(description: str) -> WithJsonSchema:
    return WithJsonSchema(
        {"type": "object", "additionalProperties": True, "description": description}
    )


SettingsDocument = TypeAliasType(
    "SettingsDocument",
    Annotated[
        dict[str, Any],
        _json_object(
            "Values of one kind of settings, or some of them; see `GET /api/config/{kind}/schema`. "
            "Those of an earlier version are told as they were saved."
        ),
    ],
)
"""Settings whose fields their own JSON Schema tells, which forms are made from."""


class SettingsPatch(RootModel[dict[str, Any]]):
    """Fields of one kind of settings that change; null returns one to its preset."""


class JsonSchema(RootModel[dict[str, Any]]):
    """A JSON Schema, with title, unit, bounds and help of every field."""


class VehicleUpload(RootModel[dict[str, Any]]):
    """Parameters of a vehicle, every number with its unit; 422 names what is wrong in one."""


EventData = TypeAliasType(
    "EventData",
    Annotated[dict[str, Any], _json_object("Ids and figures of an event; its `kind` says which.")],
)


RobotLevel = Annotated[str, one_of("normal", *ALARM_LEVELS)]
"""How much an alarm matters."""
