"""Waters: listed, added, changed, retired; their outline and depths in full."""

import asyncio
from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter, Depends, Header, Query, Response

from autonomy.frames import wgs84_from_ned
from autonomy.outline import Outline
from autonomy.site import Site
from db.fault import UnknownIdError
from db.query.fleet.waters import WaterRecord
from db.record import same
from server.access.caller import Caller
from server.access.dependency import Admin, Viewer
from server.access.idempotency import IdempotentRoute
from server.base.dependency import service
from server.base.problem import not_found
from server.base.view import JsonSchema, encoded
from server.water.view import DepthsView, NewWater, WaterChanges, WaterView
from server.water.waters import Waters, etag

router = APIRouter(prefix="/api/waters", tags=["waters"], route_class=IdempotentRoute)

WatersDep = Annotated[Waters, Depends(service(Waters))]
Lines = Annotated[int, Query(ge=2, le=1000, description="Lines of the longer side at most.")]


@router.get("")
async def list_waters(caller: Viewer, waters: WatersDep) -> list[WaterView]:
    """Return every water, retired ones too."""
    seen = caller.rights.robots
    return [_view(water, _among(robots, seen)) for water, robots in await waters.list()]


@router.post("", status_code=201)
async def create_water(
    caller: Admin, water: NewWater, waters: WatersDep, response: Response
) -> WaterView:
    """Add a water by its document, by what was read from files and is confirmed here, or by both.

    422 names each field or feature that is wrong; nothing is kept then.
    """
    record, robots = await waters.add(water, by=caller.name)
    response.headers["ETag"] = etag(record)
    return _view(record, robots)


@router.get("/{water}")
async def get_water(caller: Viewer, water: str, waters: WatersDep, response: Response) -> WaterView:
    """Return one water; its version is the ``ETag``."""
    record, robots = await _seen(waters, caller, water)
    response.headers["ETag"] = etag(record)
    return _view(record, robots)


@router.patch("/{water}")
async def patch_water(
    caller: Admin,
    water: str,
    changes: WaterChanges,
    waters: WatersDep,
    response: Response,
    if_match: Annotated[str | None, Header()] = None,
) -> WaterView:
    """Change a water, retire it or bring it back.

    412 says that it has another version than ``If-Match``. Robots that work there have the new
    document at once; plans that were made before are checked anew when they are sent.
    """
    record, robots = await waters.change(water, changes, by=caller.name, if_match=if_match)
    response.headers["ETag"] = etag(record)
    return _view(record, robots)


@router.get("/{water}/outline", response_model=JsonSchema)
async def get_outline(caller: Viewer, water: str, waters: WatersDep) -> Response:
    """Return shoreline with islands, keep-outs and places in full, as GeoJSON (RFC 7946)."""
    record, _ = await _seen(waters, caller, water)
    return encoded(await asyncio.to_thread(_geojson, record.site))


@router.get("/{water}/depths", response_model=DepthsView)
async def get_depths(caller: Viewer, water: str, waters: WatersDep, lines: Lines = 200) -> Response:
    """Return the floor at evenly spaced lines, interpolated between those that are kept."""
    record, _ = await _seen(waters, caller, water)
    if record.site.depth_lines is None:
        raise not_found(f"{water} has no depths: its floor is flat.")
    return encoded(await asyncio.to_thread(_depths, record.site, lines))


@router.get("/{water}/on-board")
async def get_on_board(caller: Viewer, water: str, waters: WatersDep) -> Site:
    """Return the document that a robot takes with it: the part about the water's domain.

    Outline and floor fit into the document, and leave the water nowhere.
    """
    del caller
    return await waters.on_board(water)


def _view(water: WaterRecord, robots: tuple[str, ...]) -> WaterView:
    return same(
        WaterView,
        water,
        name=water.site.name,
        document=water.site,
        robots=list(robots),
        is_retired=water.retired_at is not None,
    )


async def _seen(waters: Waters, caller: Caller, water: str) -> tuple[WaterRecord, tuple[str, ...]]:
    """Return a water with those of its robots that somebody may see.

    Waters are everybody's who signs in; a read-only link has only those of the robots it shows.

    Raises:
        UnknownIdError: If there is no such water, or the link shows none of its robots.
    """
    record, robots = await waters.get(water)
    shown = _among(robots, caller.rights.robots)
    if caller.is_link and not shown:
        raise UnknownIdError("water", water)
    return record, shown


def _among(robots: tuple[str, ...], seen: frozenset[str] | None) -> tuple[str, ...]:
    """Return of these robots those that somebody may see."""
    return robots if seen is None else tuple(robot for robot in robots if robot in seen)


def _geojson(site: Site) -> dict[str, Any]:
    features: list[dict[str, Any]] = []
    if site.shore is not None:
        name = "Shore" if site.shoreline is None else site.shoreline.name
        features.append(_polygon(site, site.shore, name, "outline"))
    features += [_polygon(site, area.outline, area.name, "keep_out") for area in site.keep_outs]
    features += [
        {
            "type": "Feature",
            "geometry": {
                "type": "Point",
                "coordinates": [place.longitude_deg, place.latitude_deg],
            },
            "properties": {"name": place.name, "role": place.kind, "depth_m": place.depth_m},
        }
        for place in site.places
    ]
    return {"type": "FeatureCollection", "features": features}


def _polygon(site: Site, outline: Outline, name: str, role: str) -> dict[str, Any]:
    origin = (site.origin_latitude_deg, site.origin_longitude_deg)
    rings: list[list[list[float]]] = []
    for number, ring in enumerate(outline.rings):
        places = wgs84_from_ned(ring, *origin)[:, ::-1]
        north, east = ring.T
        turns_left = float(north @ np.roll(east, -1) - east @ np.roll(north, -1)) < 0.0
        if turns_left != (number == 0):  # the standard's hand rule
            places = places[::-1]
        closed = np.concatenate([places, places[:1]]).round(8)
        rings.append(closed.tolist())
    return {
        "type": "Feature",
        "geometry": {"type": "Polygon", "coordinates": rings},
        "properties": {"name": name, "role": role},
    }


def _depths(site: Site, lines: int) -> DepthsView:
    known = site.depth_lines
    assert known is not None  # noqa: S101 - the caller looked
    sides = [float(np.ptp(axis)) for axis in known]
    counts = [max(round(lines * side / max(sides)), 2) for side in sides]
    north, east = (
        np.linspace(axis[0], axis[-1], min(count, len(axis)))
        for axis, count in zip(known, counts, strict=True)
    )
    depth = site.floor_m(north[:, None], east[None, :]).round(2)
    return DepthsView(
        north.round(2).tolist(),
        east.round(2).tolist(),
        depth.tolist(),
        site.depth_datum,
        site.tide_offset_m,
    )
