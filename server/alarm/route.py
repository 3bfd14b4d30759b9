"""Alarms and their acknowledgement (ISA-18.2)."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Literal

from fastapi import APIRouter, Query
from pydantic import AwareDatetime

from db.query.station.alarms import AlarmRecord, alarms_of, closed_alarms
from db.record import same
from server.access.dependency import Pilot, Viewer
from server.base.dependency import DeploymentDep, FoundationDep, period_of
from server.base.view import RobotLevel, View, one_of

router = APIRouter(prefix="/api/alarms", tags=["alarms"])


@dataclass(frozen=True, slots=True)
class AlarmView(View):
    """One alarm and where it stands in its life cycle."""

    id: str
    robot: str | None
    level: RobotLevel
    text: str
    state: Annotated[str, one_of("unacknowledged", "acknowledged", "returned", "closed")]
    """``unacknowledged``, ``acknowledged``, ``returned`` (normal again, unseen) or ``closed``."""
    raised_at: datetime
    acknowledged_at: datetime | None
    acknowledged_by: str | None
    cleared_at: datetime | None


@dataclass(frozen=True, slots=True)
class AlarmsView(View):
    """Alarms, the open ones the oldest first, closed ones the newest first."""

    alarms: list[AlarmView]


@router.get("")
async def list_alarms(
    caller: Viewer,
    foundation: FoundationDep,
    deployment: DeploymentDep,
    state: Annotated[Literal["open", "closed"], Query()] = "open",
    limit: Annotated[int, Query(ge=1, le=1000)] = 200,
) -> AlarmsView:
    """Return the open alarms or the closed ones; of a deployment all, the newest first."""
    del caller
    if deployment is not None:
        period = period_of(deployment) or deployment.period
        alarms = await foundation.store.query(
            lambda session: alarms_of(session, deployment.robot, period, limit)
        )
        return AlarmsView([_view(alarm) for alarm in alarms])
    if state == "open":
        return AlarmsView([_view(alarm) for alarm in foundation.alarms.open][:limit])
    closed = await foundation.store.query(lambda session: closed_alarms(session, limit))
    return AlarmsView([_view(alarm) for alarm in closed])


@router.post("/{alarm}/ack")
async def acknowledge(
    caller: Pilot,
    alarm: str,
    foundation: FoundationDep,
    raised_at: Annotated[
        AwareDatetime | None, Query(description="Since when it stood as it was seen.")
    ] = None,
    level: Annotated[str | None, Query(description="Its level as it was seen.")] = None,
) -> AlarmView:
    """Say that one has seen an alarm; doing so twice changes nothing.

    409 if it was raised anew, or is of another level, since it was seen.
    """
    return _view(
        await foundation.alarms.acknowledge(alarm, caller.name, raised_at=raised_at, level=level)
    )


def _view(alarm: AlarmRecord) -> AlarmView:
    return same(AlarmView, alarm)
