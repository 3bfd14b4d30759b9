"""A link is tried before a robot has it: what is heard there, or the plain reason why not."""

import asyncio
from collections import defaultdict
from dataclasses import dataclass
from typing import Annotated

from fastapi import APIRouter, Depends
from pydantic import Field

from db.record import same
from robot_link.messages import LinkState
from server.access.dependency import Admin
from server.base.dependency import FoundationDep, service
from server.base.problem import FieldError, unprocessable
from server.base.settings import Settings
from server.base.view import Body, View
from server.fleet.dependency import FleetDep
from server.fleet.disabled_links import shared_port
from server.fleet.fleet import Fleet
from server.fleet.link_view import LinkStateName
from server.fleet.status import RobotStatus
from server.link.examination import Examination, HeardSystem, examine_link

router = APIRouter(prefix="/api/links", tags=["links"])
_AT_ONCE = 2


class LinkTrials:
    """Tries links one after another at each port, and few at once. Belongs to one event loop."""

    def __init__(self) -> None:
        self._ports: defaultdict[str, asyncio.Lock] = defaultdict(asyncio.Lock)
        self._places = asyncio.Semaphore(_AT_ONCE)

    async def examine(
        self, uri: str, settings: Settings, listen_s: float
    ) -> tuple[Examination, list[str]]:
        """Examine a link; return what became of it with every sentence.

        Raises:
            ValueError: If the link names none.
        """
        lines: list[str] = []
        async with self._ports[shared_port(uri)], self._places:
            found = await examine_link(uri, settings, listen_s, lines.append, is_brief=True)
            return found, lines


LinkTrialsDep = Annotated[LinkTrials, Depends(service(LinkTrials))]


class LinkTrialRequest(Body):
    """Which link to try."""

    uri: str = Field(max_length=500)
    """Address of the link, such as ``xbee:///dev/ttyUSB0``."""
    system_id: int | None = Field(default=None, ge=1, le=249)
    """The MAVLink system id that the robot is to have there."""
    seconds: float = Field(default=2.0, gt=0.0, le=10.0)
    """How long to listen."""


@dataclass(frozen=True, slots=True)
class HeardSystemView(View):
    """A system that spoke on a link."""

    system_id: int
    title: str
    protocol: str
    age_s: float
    frames: int
    is_signed: bool
    robot: str | None
    """The robot that has this system id already."""


@dataclass(frozen=True, slots=True)
class LinkTrialView(View):
    """What a link brought."""

    uri: str
    state: LinkStateName
    is_well: bool
    text: str
    """The verdict in one sentence."""
    shown: str
    """What the station would show of the link."""
    lines: list[str]
    """Every finding, with what to try."""
    heard: list[HeardSystemView]
    used_by: list[str]
    """Robots that use its port already: it was not opened a second time."""


@router.post("/test")
async def try_link(
    caller: Admin,
    body: LinkTrialRequest,
    trials: LinkTrialsDep,
    fleet: FleetDep,
    foundation: FoundationDep,
) -> LinkTrialView:
    """Open a link for a moment and tell what is heard there; one in use is left alone.

    Nothing is sent that costs anything. 422 with the reason if it is no link.
    """
    del caller
    users = _users(fleet, body.uri)
    if users:
        return _of_used(fleet, body.uri, users)
    try:
        found, lines = await trials.examine(body.uri, foundation.settings, body.seconds)
    except ValueError as error:
        field = FieldError(loc=["uri"], msg=str(error))
        raise unprocessable("1 field is wrong.", [field]) from error
    return LinkTrialView(
        uri=body.uri,
        state=found.state.value,
        is_well=found.is_well,
        text=_verdict(found, lines, body.system_id, fleet),
        shown=found.shown,
        lines=lines,
        heard=[
            same(HeardSystemView, one, robot=_owner(fleet, one.system_id)) for one in found.heard
        ],
        used_by=[],
    )


def _users(fleet: Fleet, uri: str) -> list[RobotStatus]:
    port = shared_port(uri)
    return [one for one in fleet.statuses if port in map(shared_port, one.record.links)]


def _of_used(fleet: Fleet, uri: str, users: list[RobotStatus]) -> LinkTrialView:
    """Tell of a link whose port is in use, without touching it."""
    names = " and ".join(one.record.id for one in users)
    heard = [
        HeardSystemView(
            system_id=one.record.system_id,
            title=one.record.name,
            protocol=one.record.protocol,
            age_s=fleet.age_s(link.heard_at),
            frames=link.frames_received,
            is_signed=bool(link.is_signed),
            robot=one.record.id,
        )
        for one in users
        for link in one.links.values()
        if shared_port(link.uri) == shared_port(uri)
        and one.record.system_id is not None
        and link.heard_at is not None
    ]
    last = min((one.age_s for one in heard), default=None)
    ago = "not heard yet" if last is None else f"last heard {last:.1f} s ago"
    text = f"{names} uses this port already ({ago}); robots may share a radio."
    state = LinkState.LIVE if heard else LinkState.NEVER_HEARD
    return LinkTrialView(
        uri=uri,
        state=state.value,
        is_well=bool(heard),
        text=text,
        shown="The station will show the new robot as live once it speaks on this radio.",
        lines=[text],
        heard=heard,
        used_by=[one.record.id for one in users],
    )


def _owner(fleet: Fleet, system_id: int) -> str | None:
    return next(
        (one.record.id for one in fleet.statuses if one.record.system_id == system_id), None
    )


def _verdict(found: Examination, lines: list[str], wanted: int | None, fleet: Fleet) -> str:
    """Say in one sentence what was heard, or why nothing was."""
    if not found.heard:
        return next((line for line in lines if line != "The port is open."), found.shown)
    mine = next((one for one in found.heard if one.system_id == wanted), None)
    if mine is not None:
        return f"Heard {_named(mine)}."
    names = ", ".join(_named(one) for one in found.heard)
    if wanted is None:
        return f"Heard {names}."
    owners = [name for one in found.heard if (name := _owner(fleet, one.system_id)) is not None]
    whose = f" (of {' and '.join(owners)})" if owners else ""
    return f"Heard {names}{whose}, but not system {wanted}."


def _named(one: HeardSystem) -> str:
    return f"system {one.system_id}, {one.title}, {one.age_s:.1f} s ago"
