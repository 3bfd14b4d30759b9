"""Parents of views and of request bodies, and how a large view goes out."""

import msgspec
from fastapi import Response
from pydantic import BaseModel, ConfigDict


class View:
    """Lets the docstring below a field become its description in the OpenAPI schema."""

    __slots__ = ()
    __pydantic_config__ = ConfigDict(use_attribute_docstrings=True)


def encoded(view: object) -> Response:
    """Return a large view as JSON at once; its route declares the schema as ``response_model``."""
    if isinstance(view, BaseModel):
        return Response(view.model_dump_json(), media_type="application/json")
    return Response(msgspec.json.encode(view), media_type="application/json")


class Body(BaseModel):
    """A closed body: an unknown field is an error, so that a typo is not silently ignored."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)
