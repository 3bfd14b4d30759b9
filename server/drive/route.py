"""Driving a robot by hand: a WebSocket of sticks, and how a robot is driven now."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Annotated, Final

import msgspec
from fastapi import APIRouter, Depends, WebSocket, WebSocketDisconnect
from pydantic import ValidationError

from db.fault import StoreUnavailableError
from robot_link.drive import Stick
from server.access.caller import Caller
from server.access.dependency import GuardDep, SignInWatchDep, Viewer, WebSocketPilot
from server.access.role import Right
from server.access.stream import SignInWatch, serve_stream
from server.base.dependency import service
from server.base.problem import Problem
from server.drive.drives import Drive, Drives
from server.drive.view import DriveView, StickBody, refused
from server.fleet.words import sentence

router = APIRouter(prefix="/api/robots", tags=["drive"])

DrivesDep = Annotated[Drives, Depends(service(Drives))]
TELL_S: Final = 0.5
"""The pilot is told how it stands this often, even when nothing is new."""
_LEAST_S: Final = 0.05
STICK_BYTES_MAX: Final = 300
REFUSED: Final = 4409
"""Code with which the socket of whoever may not drive is closed."""
STOP: Final = "stop"
"""What a page says to end the drive, in place of a stick."""
_encoder = msgspec.json.Encoder()


@router.get("/{robot}/drive")
async def get_drive(caller: Viewer, robot: str, drives: DrivesDep) -> DriveView:
    """Return who drives a robot by hand, how it answers, or why nobody can begin now."""
    del caller
    return drives.view(robot)


@router.websocket("/{robot}/drive")
async def drive(
    websocket: WebSocket,
    caller: WebSocketPilot,
    watch: SignInWatchDep,
    guard: GuardDep,
    drives: DrivesDep,
    robot: str,
) -> None:
    """Let the caller drive: opening it begins, closing it ends, and each message is a stick.

    They must be in charge of the robot, and are from then on if nobody was. Whoever may not is told
    why (``DriveView``, *ended*), and the socket is closed with 4409.
    """
    await websocket.accept()
    try:
        guard.check_script(caller)
        await guard.check_robots(caller, Right.PILOT, (robot,), websocket, sends=True)
        is_script = caller.proof.kind == "token"
        begun = await drives.begin(robot, caller.name, is_script=is_script)
    except (Problem, StoreUnavailableError) as error:
        reason = error.detail if isinstance(error, Problem) else sentence(error)
        await websocket.send_text(_encoder.encode(refused(robot, reason)).decode())
        await websocket.close(REFUSED)
        return
    try:
        await _serve(websocket, watch, caller, drives, begun)
    finally:
        reason = "The page was closed, its connection broke, or its sign-in ended."
        await asyncio.shield(drives.finishing(begun, reason))


async def _serve(
    websocket: WebSocket, watch: SignInWatch, caller: Caller, drives: Drives, begun: Drive
) -> None:
    """Serve until either side has gone or the drive has ended."""

    async def hear() -> None:
        while True:
            message = await websocket.receive()
            if message["type"] == "websocket.disconnect":
                raise WebSocketDisconnect
            text = message.get("text") or ""
            if text == STOP:
                begun.end(f"{caller.name} stopped.")
                continue
            try:
                begun.steer(*_stick(text))
                watch.presence.note(caller, is_change=True)
            except ValueError as error:
                begun.end(f"A stick was refused: {error}")

    async def drive_on() -> None:
        async with asyncio.TaskGroup() as group:
            group.create_task(begun.run(), name=f"sticks for {begun.robot}")
            await _tell(begun, lambda: websocket.send_text(_text(drives, begun)))

    await serve_stream(websocket, watch, caller, "drive", drive_on, hear)


async def _tell(begun: Drive, send: Callable[[], Awaitable[None]]) -> None:
    """Tell the pilot what is new, at most twenty times a second; return after the last word."""
    while begun.state != "ended":
        begun.changed.clear()
        await send()
        await asyncio.sleep(_LEAST_S)
        try:
            async with asyncio.timeout(TELL_S - _LEAST_S):
                await begun.changed.wait()
        except TimeoutError:
            continue
    await send()


def _text(drives: Drives, begun: Drive) -> str:
    return _encoder.encode(drives.view_of(begun)).decode()


def _stick(text: str) -> tuple[Stick, int]:
    """Read a stick.

    Raises:
        ValueError: With the field and its limit.
    """
    if len(text) > STICK_BYTES_MAX:
        raise ValueError(f"a message is at most {STICK_BYTES_MAX} octets.")
    try:
        body = StickBody.model_validate_json(text)
    except ValidationError as error:
        first = error.errors()[0]
        field = ".".join(map(str, first["loc"])) or "message"
        raise ValueError(f"{field}: {first['msg']}.") from error
    return Stick(body.forward, body.turn, body.up), body.n
