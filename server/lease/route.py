"""Who is in charge of each robot, and the switch that holds automation."""

from dataclasses import replace
from typing import Annotated, Literal

from fastapi import APIRouter, Depends
from pydantic import AfterValidator, Field

from db.query.fleet.leases import LeaseRecord
from server.access.caller import Caller
from server.access.dependency import Pilot, PilotAtOnce, Viewer
from server.access.role import Right
from server.base.dependency import service
from server.base.problem import FieldError, Problem, unprocessable
from server.base.text import NAME_LENGTH_MAX, Name, checked
from server.base.view import Body
from server.fleet.dependency import FleetDep
from server.fleet.fleet import Fleet
from server.lease.ground_station import GroundStations
from server.lease.hold import AutomationHold, HoldView
from server.lease.leases import Leases
from server.lease.view import LeaseView, lease_view

router = APIRouter(prefix="/api", tags=["pilot in charge"])

LeasesDep = Annotated[Leases, Depends(service(Leases))]
StationsDep = Annotated[GroundStations, Depends(service(GroundStations))]
HoldDep = Annotated[AutomationHold, Depends(service(AutomationHold))]
Note = Annotated[str, Field(max_length=300), AfterValidator(checked)]


class LeaseChange(Body):
    """What becomes of who is in charge of a robot."""

    act: Literal["take", "request", "withdraw", "grant", "refuse", "hand_over", "release"]
    """``take`` a robot that is free, a script's, or whose pilot is silent; an administrator with a
    ``note`` takes any. ``request`` it from who is in charge, or ``withdraw`` that; who is in charge
    may ``grant`` or ``refuse`` it, ``hand_over`` the robot or ``release`` it."""
    to: Name | None = None
    """Who gets it by ``hand_over``; whose request ``grant`` and ``refuse`` answer."""
    note: Note = ""
    """Why, for the log and the other."""


class ScriptLeave(Body):
    """Which script may act while a person is in charge."""

    token: Annotated[str, Field(max_length=NAME_LENGTH_MAX)] | None
    """Id of the token of the script that was refused last, or ``null`` for none."""


class HoldBody(Body):
    """Whether automation is to be held."""

    is_held: bool
    """Whether scripts and all that sends or plans by itself stand still."""
    reason: Note = ""
    """Why; shown on every page while it is held."""


@router.get("/leases")
async def list_leases(
    caller: Viewer, leases: LeasesDep, stations: StationsDep, fleet: FleetDep
) -> list[LeaseView]:
    """Return who is in charge of each robot, in the order of the fleet."""
    return [
        await _view(leases, stations, caller, leases.of(status.record.id))
        for status in fleet.statuses
        if status.record.system_id is not None
        and not status.is_retired
        and caller.rights.sees(status.record.id)
    ]


@router.post("/leases/release")
async def release_leases(
    caller: Pilot, leases: LeasesDep, stations: StationsDep
) -> list[LeaseView]:
    """Give back every robot that the caller is in charge of: the end of a shift."""
    return [await _view(leases, stations, caller, one) for one in await leases.release_all(caller)]


@router.get("/robots/{robot}/lease")
async def get_lease(
    caller: Viewer, robot: str, leases: LeasesDep, stations: StationsDep
) -> LeaseView:
    """Return who is in charge of a robot, who asks for it, and what the caller can do."""
    return await _view(leases, stations, caller, leases.of(robot))


@router.post("/robots/{robot}/lease")
async def change_lease(
    caller: Pilot, robot: str, body: LeaseChange, leases: LeasesDep, stations: StationsDep
) -> LeaseView:
    """Take, request, grant, refuse, hand over or release a robot; 409 says why that cannot be.

    Whoever sends something to a robot that nobody holds is in charge of it from then on; this is
    needed where somebody else is. To surface a robot needs no lease.
    """
    match body.act:
        case "take":
            lease = await leases.take(robot, caller, body.note)
        case "request":
            lease = await leases.request(robot, caller, body.note)
        case "withdraw":
            lease = await leases.withdraw(robot, caller)
        case "grant" | "refuse" as act:
            grants, to = act == "grant", _to(body)
            lease = await leases.answer(robot, caller, requester=to, grants=grants, note=body.note)
        case "hand_over":
            lease = await leases.hand_over(robot, caller, _to(body), body.note)
        case "release":
            lease = await leases.release(robot, caller)
    return await _view(leases, stations, caller, lease)


@router.put("/robots/{robot}/lease/script")
async def let_script_act(
    caller: Pilot, robot: str, body: ScriptLeave, leases: LeasesDep, stations: StationsDep
) -> LeaseView:
    """Let a script act while the caller is in charge; that ends with it."""
    return await _view(leases, stations, caller, await leases.let_script(robot, caller, body.token))


@router.get("/automation")
async def get_automation(caller: Viewer, hold: HoldDep, fleet: FleetDep) -> HoldView:
    """Return whether automation is held: every script, and everything that sends by itself."""
    return replace(hold.view, refusal=_refusal_to_resume(caller, fleet))


@router.put("/automation")
async def hold_automation(
    caller: PilotAtOnce, body: HoldBody, hold: HoldDep, fleet: FleetDep
) -> HoldView:
    """Hold automation, or let it go on; 409 if it is so already.

    While it is held, every change by a script is refused but an order to surface, and plans that
    wait to be sent, rounds of surveys and suggestions wait. A script may hold it, but not let it
    go on. Who pilots any robot may hold it; who pilots all of them may let it go on.
    """
    if not any(_piloted(caller, fleet)) and not caller.rights.may(Right.PILOT):
        raise Problem(403, f"{caller.name} pilots no robot and may not do this.")
    refusal = _refusal_to_resume(caller, fleet)
    if not body.is_held:
        hold.refuse(caller)
        if refusal:
            raise Problem(403, refusal)
    held = await hold.set(held=body.is_held, by=caller.name, reason=body.reason)
    return replace(held, refusal=refusal)


def _piloted(caller: Caller, fleet: Fleet) -> list[bool]:
    """Return of each robot whether somebody pilots it."""
    return [caller.rights.may(Right.PILOT, status.record.id) for status in fleet.statuses]


def _refusal_to_resume(caller: Caller, fleet: Fleet) -> str:
    """Return why somebody cannot let the automation of all robots go on, "" if they can."""
    if caller.rights.may(Right.PILOT):
        return ""
    piloted = _piloted(caller, fleet)
    if not any(piloted):
        return f"{caller.name} pilots no robot and may not do this."
    if not all(piloted):
        return f"{caller.name} pilots chosen robots; this lets all of them go on."
    return ""


async def _view(
    leases: Leases, stations: GroundStations, caller: Caller, lease: LeaseRecord
) -> LeaseView:
    limits, me = await leases.limits(lease.robot), await leases.holder(caller)
    return lease_view(leases, stations, lease, limits, me)


def _to(body: LeaseChange) -> str:
    """Return whom an act is about.

    Raises:
        Problem: 422 if it names nobody.
    """
    if body.to is None:
        message = f"{body.act} needs to say whom"
        raise unprocessable("1 field is wrong.", [FieldError(loc=["to"], msg=message)])
    return body.to
