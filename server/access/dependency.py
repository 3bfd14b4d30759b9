"""What a route may ask for in its signature.

A route names the right it needs by the type of its caller, and so cannot forget it::

    @router.get("/api/robots")
    async def list_robots(caller: Viewer, foundation: FoundationDep) -> list[RobotView]: ...
"""

from typing import Annotated

from fastapi import Depends, Request, WebSocket
from starlette.requests import HTTPConnection

from db.store import Store
from robot_link.clock import Clock
from server.access.access import Caller
from server.access.foundation import Foundation
from server.access.role import Right


def get_foundation(connection: HTTPConnection) -> Foundation:
    """Return the foundation of the application that serves this connection."""
    return connection.app.state.foundation


FoundationDep = Annotated[Foundation, Depends(get_foundation)]


def get_store(foundation: FoundationDep) -> Store:
    """Return the station's memory."""
    return foundation.store


def get_clock(foundation: FoundationDep) -> Clock:
    """Return the robots' clock."""
    return foundation.clock


StoreDep = Annotated[Store, Depends(get_store)]
ClockDep = Annotated[Clock, Depends(get_clock)]


async def _viewer(request: Request, foundation: FoundationDep) -> Caller:
    return await foundation.guard.caller(request, Right.VIEW)


async def _pilot(request: Request, foundation: FoundationDep) -> Caller:
    return await foundation.guard.caller(request, Right.PILOT)


async def _admin(request: Request, foundation: FoundationDep) -> Caller:
    return await foundation.guard.caller(request, Right.ADMINISTER)


async def _websocket_viewer(websocket: WebSocket, foundation: FoundationDep) -> Caller:
    return await foundation.guard.websocket_caller(websocket)


Viewer = Annotated[Caller, Depends(_viewer)]
"""Who asks; may look."""
Pilot = Annotated[Caller, Depends(_pilot)]
"""Who asks; may plan, upload, command and configure."""
Admin = Annotated[Caller, Depends(_admin)]
"""Who asks; may change people, tokens and robots."""
WebSocketViewer = Annotated[Caller, Depends(_websocket_viewer)]
"""Who opens the WebSocket; refused before it is accepted."""
