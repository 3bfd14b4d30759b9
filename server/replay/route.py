"""A robot at a moment of the past, and the time that a replay runs over."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query, Response
from pydantic import AwareDatetime

from robot_link.messages import RobotId
from server.access.dependency import Viewer
from server.base.dependency import service
from server.base.view import encoded
from server.replay.replays import Replays
from server.replay.view import RobotThenView, TimelineView
from server.scene.replay_source import Clock

router = APIRouter(prefix="/api/robots/{robot}", tags=["replay"])

ReplaysDep = Annotated[Replays, Depends(service(Replays))]
At = Annotated[AwareDatetime, Query(description="The moment, RFC 3339.")]


@router.get("/moment", response_model=RobotThenView)
async def robot_at_moment(
    caller: Viewer,
    robot: RobotId,
    replays: ReplaysDep,
    at: At,
    clock: Annotated[
        Clock,
        Query(
            description="`measured`: what happened, also what was told later. `received`: what "
            "the station had heard by then."
        ),
    ] = "measured",
) -> Response:
    """Return the newest of everything that was known of a robot at a moment, each with its age.

    By `measured`, what a robot under water measured before and told later is among it. 422 for a
    moment that has not come yet.
    """
    del caller
    return encoded(await replays.moment(robot, at, clock))


@router.get("/timeline")
async def timeline_around(
    caller: Viewer, robot: RobotId, replays: ReplaysDep, at: At
) -> TimelineView:
    """Return the deployment that a moment belongs to, from end to end, with what happened in it.

    Of a robot in no deployment, the twelve hours before and after.
    """
    del caller
    return await replays.timeline(robot, at)
