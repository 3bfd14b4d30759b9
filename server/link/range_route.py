"""Acoustic ranges between the station and its robots."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from fastapi import APIRouter, Query

from db.query.measured.ranges import list_ranges
from db.record import same
from server.access.dependency import Viewer
from server.base.dependency import StoreDep
from server.base.view import View

router = APIRouter(prefix="/api/robots", tags=["robots"])


@dataclass(frozen=True, slots=True)
class RangeView(View):
    """One range, good or bad."""

    at: datetime
    peer: int
    """Address of the robot's acoustic modem."""
    travel_time_s: float | None
    """One way; ``null`` without an answer."""
    range_m: float | None
    """Slant range: travel time by speed of sound."""
    is_valid: bool
    reason: str
    """Why it is not valid; empty when it is."""


@dataclass(frozen=True, slots=True)
class RangesView(View):
    """Ranges of one robot, the newest first."""

    robot: str
    ranges: list[RangeView]


@router.get("/{robot}/ranges")
async def get_ranges(
    caller: Viewer,
    robot: str,
    store: StoreDep,
    limit: Annotated[int, Query(ge=1, le=10_000)] = 1000,
) -> RangesView:
    """Return the newest acoustic ranges of a robot, those without an answer among them."""
    del caller
    found = await store.query(lambda session: list_ranges(session, robot, limit))
    return RangesView(
        robot,
        [same(RangeView, one) for one in found],
    )
