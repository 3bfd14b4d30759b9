"""Base maps come in, are listed, and are drawn tile by tile."""

import asyncio
import errno
from dataclasses import dataclass
from typing import Annotated, Final

from fastapi import APIRouter, Depends, File, Path, Response, UploadFile

from db.query.station.events import add_event
from server.access.dependency import Pilot, Viewer
from server.base.dependency import FoundationDep, service
from server.base.foundation import Foundation
from server.base.problem import FieldError, Problem, conflict, not_found, unprocessable
from server.base.view import View
from server.base_map.base_maps import (
    ID_PATTERN,
    BaseMap,
    BaseMapExistsError,
    BaseMaps,
    UnknownBaseMapError,
)
from server.base_map.tile_file import ZOOM_MAX
from server.base_map.tile_image import TileFileError

router = APIRouter(prefix="/api/base-maps", tags=["base maps"])

RESOURCE: Final = "base_maps"
_TILE_HEADERS: Final = {
    "Cache-Control": "private, max-age=604800",
    "Content-Security-Policy": "default-src 'none'; sandbox",
    "X-Content-Type-Options": "nosniff",
}
_SIDE_MAX: Final = 2**ZOOM_MAX - 1
BaseMapsDep = Annotated[BaseMaps, Depends(service(BaseMaps))]
BaseMapId = Annotated[str, Path(pattern=ID_PATTERN, description="Id of a base map.")]
Zoom = Annotated[int, Path(ge=0, le=ZOOM_MAX, description="Zoom of Web Mercator.")]
Column = Annotated[int, Path(ge=0, le=_SIDE_MAX, description="Column from the antimeridian.")]
Row = Annotated[int, Path(ge=0, le=_SIDE_MAX, description="Row from the north.")]


@dataclass(frozen=True, slots=True)
class BaseMapView(View):
    """A chart or picture that may lie under every map."""

    id: str
    title: str
    """As the file calls itself."""
    attribution: str
    """Who is to be named where it is shown; plain text."""
    format: str
    """Media type of its tiles."""
    west_deg: float
    """May be beyond the east edge: such a map crosses the antimeridian."""
    south_deg: float
    east_deg: float
    north_deg: float
    min_zoom: int
    max_zoom: int
    bytes: int
    """Size of the file."""
    file: str
    revision: str
    """Changes with the file; put it behind a tile's address as `?revision=`."""


@dataclass(frozen=True, slots=True)
class RefusedFileView(View):
    """A file in the folder of base maps that is none."""

    file: str
    reason: str


@dataclass(frozen=True, slots=True)
class BaseMapsView(View):
    """The base maps of the station."""

    base_maps: list[BaseMapView]
    refused: list[RefusedFileView]
    """Files beside them that cannot be used, and why."""


@router.get("")
async def list_base_maps(caller: Viewer, maps: BaseMapsDep) -> BaseMapsView:
    """Return the base maps: files in the folder `base-maps` of the data folder."""
    del caller
    found, refused = await asyncio.to_thread(maps.look)
    return BaseMapsView(
        [_view(one) for one in found], [RefusedFileView(one.file, one.reason) for one in refused]
    )


@router.post("", status_code=201)
async def add_base_map(
    caller: Pilot,
    file: Annotated[UploadFile, File(description="A PMTiles or MBTiles file.")],
    maps: BaseMapsDep,
    foundation: FoundationDep,
) -> BaseMapView:
    """Add a PMTiles (version 3) or MBTiles file of PNG, JPEG or WebP tiles in Web Mercator.

    Its id is made of the file's name; 409 says that it is taken. 422 says what is wrong with the
    file; nothing of it is kept then. Larger files than a request may hold are put into the folder
    by `grace base-map add`.
    """
    try:
        added = await asyncio.to_thread(maps.add, file.file, file.filename or "")
    except BaseMapExistsError as error:
        raise conflict(str(error)) from error
    except TileFileError as error:
        wrong = FieldError(loc=["file"], msg=str(error))
        raise unprocessable(f"This is no base map: {error}.", [wrong]) from error
    except OSError as error:
        if error.errno not in {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}:
            raise
        raise Problem(507, "The station has no room for this file; nothing was kept.") from error
    await _told(foundation, "base-map.added", f"{caller.name} added base map {added.title}.", added)
    return _view(added)


@router.delete("/{base_map}", status_code=204)
async def remove_base_map(
    caller: Pilot, base_map: BaseMapId, maps: BaseMapsDep, foundation: FoundationDep
) -> None:
    """Remove a base map and delete its file."""
    try:
        gone = await asyncio.to_thread(maps.remove, base_map)
    except UnknownBaseMapError as error:
        raise _unknown(base_map) from error
    text = f"{caller.name} removed base map {gone.title}."
    await _told(foundation, "base-map.removed", text, gone)


@router.get(
    "/{base_map}/tiles/{z}/{x}/{y}",
    response_class=Response,
    responses={
        200: {"content": {one: {} for one in ("image/png", "image/jpeg", "image/webp")}},
        204: {"description": "The map has no tile there."},
    },
)
async def get_tile(
    caller: Viewer, base_map: BaseMapId, z: Zoom, x: Column, y: Row, maps: BaseMapsDep
) -> Response:
    """Return a tile of a base map as a PNG, JPEG or WebP picture, rows counted from the north.

    What is told of the type comes from the picture itself. 422 says that the file holds something
    there that is not to be drawn.
    """
    del caller
    if x >> z or y >> z:
        raise not_found(f"Zoom {z} has columns and rows 0 to {2**z - 1}.")
    try:
        found = await asyncio.to_thread(maps.tile, base_map, z, x, y)
    except UnknownBaseMapError as error:
        raise _unknown(base_map) from error
    except TileFileError as error:
        raise unprocessable(f"Base map {base_map} cannot be drawn here: {error}.", []) from error
    if found is None:
        return Response(status_code=204, headers=_TILE_HEADERS)
    media_type, data = found
    return Response(data, media_type=media_type, headers=_TILE_HEADERS)


async def _told(foundation: Foundation, kind: str, text: str, base_map: BaseMap) -> None:
    at, data = foundation.clock.now(), {"base_map": base_map.id, "bytes": base_map.bytes}
    await foundation.store.write(lambda session: add_event(session, at, kind, text, data=data))
    foundation.feed.mark(RESOURCE)


def _unknown(base_map: str) -> Problem:
    return not_found(f"There is no base map {base_map}.")


def _view(base_map: BaseMap) -> BaseMapView:
    facts = base_map.facts
    return BaseMapView(
        id=base_map.id,
        title=base_map.title,
        attribution=facts.attribution,
        format=facts.media_type,
        west_deg=facts.west_deg,
        south_deg=facts.south_deg,
        east_deg=facts.east_deg,
        north_deg=facts.north_deg,
        min_zoom=facts.min_zoom,
        max_zoom=facts.max_zoom,
        bytes=base_map.bytes,
        file=base_map.file,
        revision=base_map.revision,
    )
