"""Which robots sign what they say over radio; keys are made here and shown once.

The answer that brings a key is the only one ever: it is kept by no ``Idempotency-Key``, and the
station's own copy is a file that nobody but its user may read.
"""

import asyncio
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Annotated, TypeVar

import segno
from fastapi import APIRouter
from sqlalchemy.orm import Session

from db.query.station.events import add_event
from robot_link.messages import RobotId
from server.access.dependency import Admin
from server.base.dependency import FoundationDep
from server.base.foundation import Foundation
from server.base.problem import Problem
from server.base.secret import SecretStore, SecretUnreadableError, secret_fault
from server.base.view import View, one_of
from server.fleet.dependency import FleetDep, refuse_recording
from server.fleet.event import SigningChanged

router = APIRouter(prefix="/api", tags=["links"])

T = TypeVar("T")
_QUIET_ZONE = 4
"""Light modules that a reader needs around a QR code, ISO/IEC 18004."""


@dataclass(frozen=True, slots=True)
class SigningKeyView(View):
    """A key that was made just now; it is shown here and never again."""

    robot: str
    key: str = field(repr=False)
    """32 bytes in hexadecimal, as the robot's file ``signing.key`` holds them."""
    qr: list[str] = field(repr=False)
    """The same text as a QR code: its rows of modules, ``1`` where one is dark, with the light
    margin that a camera needs."""


@dataclass(frozen=True, slots=True)
class SigningView(View):
    """Whether a robot's radio is signed."""

    robot: str
    state: Annotated[str, one_of("on", "off", "undecided", "unreadable")]
    """``on``; ``off``, as somebody decided; ``undecided``, no key was ever made and frames are not
    signed; or ``unreadable``: the key's file is damaged, and nothing is believed by radio."""
    fault: str | None
    """Why the key cannot be read."""


@dataclass(frozen=True, slots=True)
class SigningsView(View):
    """Every robot that has a radio's system id."""

    robots: list[SigningView]


def shown_key(robot: str, key: bytes) -> SigningKeyView:
    """Return what shows a key to a person and to a camera."""
    text = key.hex()
    rows = segno.make(text.upper(), error="m", micro=False).matrix_iter(border=_QUIET_ZONE)
    return SigningKeyView(robot, text, ["".join("01"[module] for module in row) for row in rows])


@router.get("/signing")
async def list_signing(caller: Admin, fleet: FleetDep, foundation: FoundationDep) -> SigningsView:
    """Return which robots sign what they say over radio; no key is among what is told."""
    del caller
    secrets = foundation.secrets
    robots = [one.record.id for one in fleet.statuses if one.record.system_id is not None]
    return SigningsView(
        await asyncio.to_thread(lambda: [_signing(secrets, robot) for robot in robots])
    )


@router.post("/robots/{robot}/signing-key", status_code=201)
async def make_signing_key(
    caller: Admin, robot: str, fleet: FleetDep, foundation: FoundationDep
) -> SigningKeyView:
    """Make a new key for a robot; the one before it ends at once.

    The robot is heard by radio again, and obeys by radio, as soon as it holds the new key.
    """
    status = fleet.status(robot)
    refuse_recording(status, "has no radio")
    text = f"{caller.name} made a new signing key for {robot}; the one before it is refused."
    key = await _decide(foundation, status.record.id, text, foundation.secrets.new_signing_key)
    return shown_key(robot, key)


@router.delete("/robots/{robot}/signing-key")
async def turn_signing_off(
    caller: Admin, robot: str, fleet: FleetDep, foundation: FoundationDep
) -> SigningView:
    """Stop signing with a robot that cannot sign; its key is gone.

    Whoever has such a radio can then pose as the robot, and as this station.
    """
    status = fleet.status(robot)
    refuse_recording(status, "has no radio")
    text = f"{caller.name} turned signing off for {robot}; its radio proves nothing any more."
    await _decide(foundation, status.record.id, text, foundation.secrets.turn_signing_off)
    return _signing(foundation.secrets, robot)


async def _decide(
    foundation: Foundation, robot: RobotId, text: str, decide: Callable[[str], T]
) -> T:
    """Keep a decision with its event, both or neither, and tell the radios."""

    def write(session: Session) -> T:
        add_event(session, foundation.clock.now(), "robot.signing", text, robot=robot)
        return decide(robot)

    try:
        made = await foundation.secrets.decide_with(foundation.store, robot, write)
    except OSError as error:
        raise Problem(503, f"The decision cannot be kept: {error.strerror}.") from error
    foundation.bus.publish(SigningChanged(robot))
    return made


def _signing(secrets: SecretStore, robot: str) -> SigningView:
    try:
        if secrets.signing_key(robot) is not None:
            with suppress(FileNotFoundError):
                secrets.signing_marks(robot).read_bytes()
            return SigningView(robot, "on", None)
    except (SecretUnreadableError, OSError) as error:
        return SigningView(robot, "unreadable", secret_fault(error))
    return SigningView(robot, "off" if secrets.is_signing_off(robot) else "undecided", None)
