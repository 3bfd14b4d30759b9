"""What a ``.plan`` cannot say, kept under its key ``grace`` and bound to its items by a hash.

QGroundControl ignores keys that it does not know, and does not write them again.
"""

import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from autonomy.design.document import RELATIVE_ROWS, Design
from autonomy.frames import wgs84_from_ned
from autonomy.site import Site
from server.plan_file.field import Document, pair_of
from server.plan_file.item import FileItem
from server.plan_file.proposal import LatitudeLongitude, NorthEast

KEY = "grace"
VERSION = 1
_PLACE_DECIMALS = 7
_DEPTH_DECIMALS = 3


def own_part(design: Design, site: Site, name: str, items: Sequence[FileItem]) -> dict[str, Any]:
    """Return what is written under the key."""
    return {
        "version": VERSION,
        "items_sha256": items_sha256(items),
        "name": name,
        "origin": [site.origin_latitude_deg, site.origin_longitude_deg],
        "design": design.model_dump(mode="json"),
    }


def items_sha256(items: Sequence[FileItem]) -> str:
    """Return the hash of what items ask for, to 1e-7 deg and 1 mm."""
    rows = [
        [
            item.command,
            item.frame,
            *(_rounded(value, _DEPTH_DECIMALS) for value in item.parameters),
            _rounded(item.x, _PLACE_DECIMALS),
            _rounded(item.y, _PLACE_DECIMALS),
            _rounded(math.nan if item.z is None else item.z, _DEPTH_DECIMALS),
        ]
        for item in items
    ]
    return hashlib.sha256(json.dumps(rows).encode()).hexdigest()


def _rounded(value: float, decimals: int) -> float | None:
    return round(value, decimals) + 0.0 if math.isfinite(value) else None


def kept_design(
    part: object,
    items: Sequence[FileItem],
    site: Site,
    place: Callable[[LatitudeLongitude], NorthEast] | None,
) -> Design | str:
    """Return the design that a file keeps of ours, or why it does not hold any more.

    Args:
        part: What stands under the key.
        items: The file's items as they are now.
        site: The water into which it is read.
        place: Where a place of the globe lies in the water's frame; None if the design stays where
            its own frame says.
    """
    if not isinstance(part, dict) or part.get("version") != VERSION:
        return "is of another version of this program"
    if part.get("items_sha256") != items_sha256(items):
        return "does not go with the items: they were changed by another program"
    origin = pair_of(part.get("origin"))
    if origin is None:
        return "names no origin of its frame"
    document = part.get("design")
    if place is not None or origin != (site.origin_latitude_deg, site.origin_longitude_deg):
        if place is None:
            return "is of another water"
        document = _brought(document, origin, place)
    try:
        return Design.model_validate(document)
    except ValidationError as error:
        first = error.errors()[0]
        return f"holds no design: {'.'.join(map(str, first['loc']))}: {first['msg']}"


def _brought(
    value: Any,  # noqa: ANN401 - any JSON
    origin: LatitudeLongitude,
    place: Callable[[LatitudeLongitude], NorthEast],
) -> Any:  # noqa: ANN401 - any JSON
    """Return a document whose places are brought from the frame of an origin into another."""
    if isinstance(value, list):
        return [_brought(each, origin, place) for each in value]
    if not isinstance(value, Mapping):
        return value
    brought = {
        key: each if key == RELATIVE_ROWS else _brought(each, origin, place)
        for key, each in value.items()
    }
    at = pair_of([brought.get("north_m"), brought.get("east_m")])
    if at is not None:
        latitude, longitude = wgs84_from_ned(at, *origin).tolist()
        brought["north_m"], brought["east_m"] = place((latitude, longitude))
    return brought


def is_of_file(document: Document) -> bool:
    """Tell whether a file holds a part of ours."""
    return document.get(KEY) is not None
