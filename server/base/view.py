"""Parent of every view, and its way out."""

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
