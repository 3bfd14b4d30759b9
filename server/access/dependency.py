"""What a route may ask for in its signature.

A route names the right it needs by the type of its caller, and so cannot forget it::

    @router.get("/api/robots")
    async def list_robots(caller: Viewer, foundation: FoundationDep) -> list[RobotView]: ...
"""

from collections.abc import Awaitable, Callable, Collection, Mapping
from types import MappingProxyType
from typing import Annotated, Final, Literal, TypeAlias

from fastapi import Depends, Request, Response, WebSocket
from fastapi.dependencies.models import Dependant
from starlette.requests import HTTPConnection

from server.access.access import Access
from server.access.caller import Caller
from server.access.guard import AT_ONCE, Guard
from server.access.rate import calls_of
from server.access.role import Right
from server.access.stream import SignInWatch, Tickets
from server.base.dependency import FoundationDep, service


async def get_guard(foundation: FoundationDep) -> Guard:
    """Return who checks the requests of this station."""
    return foundation.services.get(Guard)


async def get_access(foundation: FoundationDep) -> Access:
    """Return who knows the people of this station."""
    return foundation.services.get(Access)


AccessDep = Annotated[Access, Depends(get_access)]
SignInWatchDep = Annotated[SignInWatch, Depends(service(SignInWatch))]
TicketsDep = Annotated[Tickets, Depends(service(Tickets))]
_THIS_MACHINE: Final = frozenset({"127.0.0.1", "::1"})
GuardDep = Annotated[Guard, Depends(get_guard)]


async def _viewer(request: Request, guard: GuardDep) -> Caller:
    return await guard.caller(request, Right.VIEW)


async def _viewer_or_this_machine(
    request: Request, guard: GuardDep, foundation: FoundationDep
) -> Caller | None:
    host = None if request.client is None else request.client.host
    if host in _THIS_MACHINE and foundation.settings.metrics_on_loopback:
        return None
    return await guard.scraper(request)


async def _pilot(request: Request, guard: GuardDep) -> Caller:
    return await guard.caller(request, Right.PILOT, changes=True)


async def _pilot_in_charge(request: Request, response: Response, guard: GuardDep) -> Caller:
    caller = await guard.caller(request, Right.PILOT, sends=True, changes=True)
    _tell_taken(request, response)
    return caller


async def _pilot_at_once(request: Request, guard: GuardDep) -> Caller:
    return await guard.caller(request, Right.PILOT)


setattr(_pilot_at_once, AT_ONCE, True)


async def _admin(request: Request, guard: GuardDep) -> Caller:
    return await guard.caller(request, Right.ADMINISTER, changes=True)


async def _websocket_viewer(websocket: WebSocket, guard: GuardDep) -> Caller:
    return await guard.websocket_caller(websocket)


async def _websocket_pilot(websocket: WebSocket, guard: GuardDep) -> Caller:
    return await guard.websocket_caller(websocket, Right.PILOT)


Viewer = Annotated[Caller, Depends(_viewer)]
"""Who asks; may look."""
ViewerOrThisMachine = Annotated[Caller | None, Depends(_viewer_or_this_machine)]
"""Who asks; may look. ``None`` for somebody on this machine, where a setting lets them."""
Pilot = Annotated[Caller, Depends(_pilot)]
"""Who asks; may draft, plan, check, comment and acknowledge, whoever is in charge."""
PilotInCharge = Annotated[Caller, Depends(_pilot_in_charge)]
"""Who asks; may send the robots of the request plans, settings and orders, for they are in charge.

Whoever asks it of a robot that nobody is in charge of is so from then on."""
PilotAtOnce = Annotated[Caller, Depends(_pilot_at_once)]
"""Who asks; may pilot. Nothing else stops it here: what can bring a robot up."""
Admin = Annotated[Caller, Depends(_admin)]
"""Who asks; may change people, tokens and robots."""
WebSocketViewer = Annotated[Caller, Depends(_websocket_viewer)]
"""Who opens the WebSocket; refused before it is accepted."""
WebSocketPilot = Annotated[Caller, Depends(_websocket_pilot)]
"""Who opens a WebSocket that moves robots; refused before it is accepted."""


Robots: TypeAlias = Callable[[Collection[str]], Awaitable[None]]


async def _pilot_of(request: Request, guard: GuardDep, caller: Pilot) -> Robots:
    async def check(robots: Collection[str]) -> None:
        await guard.check_robots(caller, Right.PILOT, robots, request)

    return check


PilotOf = Annotated[Robots, Depends(_pilot_of)]
"""Refuses a request about robots that its body names, unless the caller may pilot each of them."""


async def _in_charge_of(request: Request, response: Response, guard: GuardDep) -> Robots:
    async def check(robots: Collection[str]) -> None:
        caller: Caller = request.state.caller
        guard.check_script(caller)
        await guard.check_robots(caller, Right.PILOT, robots, request, sends=True)
        _tell_taken(request, response)

    return check


InChargeOf = Annotated[Robots, Depends(_in_charge_of)]
"""Refuses a request of which its body says whether it sends robots something, unless the caller is
in charge of each of them; its route asks it after its caller is known."""

TAKEN_HEADER: Final = "Took-Charge-Of"


def tell_taken(connection: HTTPConnection, robot: str) -> None:
    """Have the answer of a request say that its caller is in charge of a robot since then."""
    taken: list[str] = getattr(connection.state, "taken", [])
    connection.state.taken = [*taken, robot]


def _tell_taken(request: Request, response: Response) -> None:
    if taken := getattr(request.state, "taken", []):
        response.headers[TAKEN_HEADER] = ", ".join(taken)


_RIGHTS: Mapping[object, Right] = MappingProxyType(
    {
        _viewer: Right.VIEW,
        _viewer_or_this_machine: Right.VIEW,
        _pilot: Right.PILOT,
        _pilot_in_charge: Right.PILOT,
        _pilot_at_once: Right.PILOT,
        _admin: Right.ADMINISTER,
    }
)


def right_of(dependant: Dependant) -> Right | None:
    """Return the right that a route's caller needs, ``None`` where the route takes anybody."""
    if dependant.call in _RIGHTS:
        return _RIGHTS[dependant.call]
    found = (right_of(one) for one in dependant.dependencies)
    return next((right for right in found if right is not None), None)


def sends_of(dependant: Dependant) -> Literal["always", "by its body"] | None:
    """Return whether a route sends robots something; ``None`` where it never does."""
    calls = calls_of(dependant)
    if _pilot_in_charge in calls:
        return "always"
    return "by its body" if _in_charge_of in calls else None
