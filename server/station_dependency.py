"""How a route reaches the services of its station."""

from typing import Annotated

import msgspec
from fastapi import Depends, Response
from pydantic import BaseModel
from starlette.requests import HTTPConnection

from server.station import Station


def get_station(connection: HTTPConnection) -> Station:
    """Return the services of the application that serves this connection."""
    return connection.app.state.station


StationDep = Annotated[Station, Depends(get_station)]


def encoded(view: object) -> Response:
    """Return a large view as JSON at once; its route declares the schema as ``response_model``."""
    if isinstance(view, BaseModel):
        return Response(view.model_dump_json(), media_type="application/json")
    return Response(msgspec.json.encode(view), media_type="application/json")
