"""Groups of robots, by which rights are given once for many."""

from dataclasses import dataclass
from typing import Annotated

from fastapi import APIRouter, Path
from pydantic import Field

from db.query.station.grants import list_groups
from server.access import register
from server.access.dependency import Admin, Viewer
from server.base.dependency import ClockDep, StoreDep
from server.base.text import NAME_LENGTH_MAX
from server.base.view import Body, View

router = APIRouter(prefix="/api/groups", tags=["people"])

GroupName = Annotated[str, Path(max_length=NAME_LENGTH_MAX)]


class GroupBody(Body):
    """Which robots a group shall have."""

    robots: list[str] = Field(max_length=1000)
    """Ids of the robots of the group."""
    seen: list[str] | None = Field(default=None, max_length=1000)
    """What it had when somebody looked; 409 where that is not so any more."""


@dataclass(frozen=True, slots=True)
class GroupView(View):
    """Robots under one name."""

    name: str
    robots: list[str]


@dataclass(frozen=True, slots=True)
class GroupsView(View):
    """Every group, by name."""

    groups: list[GroupView]


@router.get("")
async def get_groups(caller: Viewer, store: StoreDep) -> GroupsView:
    """Return every group of robots with those that the caller sees; groups of others are not told.

    An administrator sees empty groups too.
    """
    groups = await store.query(list_groups)
    seen = [
        GroupView(group.name, [robot for robot in group.robots if caller.rights.sees(robot)])
        for group in groups
    ]
    is_whole = caller.rights.robots is None
    return GroupsView([group for group in seen if group.robots or is_whole])


@router.put("/{group}", status_code=204)
async def put_group(
    caller: Admin, group: GroupName, body: GroupBody, store: StoreDep, clock: ClockDep
) -> None:
    """Let a group have these robots; whoever has a right by it has it on them at once."""
    at = clock.now()
    await store.write(
        lambda session: register.put_group(
            session, group, body.robots, seen=body.seen, at=at, by=caller.name
        )
    )


@router.delete("/{group}", status_code=204)
async def remove_group(caller: Admin, group: GroupName, store: StoreDep, clock: ClockDep) -> None:
    """Remove a group; 409 while somebody has a right by it."""
    at = clock.now()
    await store.write(lambda session: register.remove_group(session, group, at=at, by=caller.name))
