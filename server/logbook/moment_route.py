"""A robot as it was known at a moment: what an entry of the log book opens."""

from dataclasses import dataclass
from datetime import datetime
from math import isfinite
from typing import Annotated

from fastapi import APIRouter, Query
from pydantic import AwareDatetime

from autonomy.channel import ChannelCatalogue
from db.query.measured.moment import known_then
from robot_link.messages import STATE, RobotMode
from server.access.dependency import Viewer
from server.base.dependency import FoundationDep
from server.base.view import View, name_of

router = APIRouter(prefix="/api/robots/{robot}", tags=["robots"])


@dataclass(frozen=True, slots=True)
class ValueThenView(View):
    """The newest value of a channel at a moment."""

    channel: str
    unit: str
    value: float
    measured_at: datetime


@dataclass(frozen=True, slots=True)
class MomentView(View):
    """What a robot had measured by a moment, whenever the station heard of it."""

    robot: str
    at: datetime
    mode: Annotated[str, name_of(RobotMode)] | None
    """What it was doing; ``null`` where it never said."""
    mode_at: datetime | None
    north_m: float | None
    east_m: float | None
    depth_m: float | None
    position_std_m: float | None
    position_at: datetime | None
    values: list[ValueThenView]


@router.get("/moment")
async def robot_at_moment(
    caller: Viewer,
    robot: str,
    foundation: FoundationDep,
    at: Annotated[AwareDatetime, Query(description="The moment, RFC 3339.")],
) -> MomentView:
    """Return the newest value of everything that a robot had measured by a moment.

    What it measured before and told later is among it: a robot under water tells afterwards.
    """
    del caller
    known = await foundation.store.query(lambda session: known_then(session, robot, at))
    north, east, depth = known.position_ned or (None, None, None)
    std = known.position_std_m
    return MomentView(
        robot=robot,
        at=at,
        mode=known.mode,
        mode_at=known.mode_at,
        north_m=north,
        east_m=east,
        depth_m=depth,
        position_std_m=None if std is None or not isfinite(std) else std,
        position_at=known.position_at,
        values=[
            ValueThenView(
                one.channel,
                _unit(foundation.channels.catalogue, one.channel),
                one.value,
                one.measured_at,
            )
            for one in known.values
            if isfinite(one.value)
        ],
    )


def _unit(catalogue: ChannelCatalogue, channel: str) -> str:
    if channel in STATE.keys:
        return STATE[channel].unit
    known = catalogue.get(channel)
    return "" if known is None else known.unit
