"""Satellite gateways: what they push to the station, and the station's accounts with them.

Pushes carry no cookie and no token of a person. What lets one in is a word in its path that
only the gateway knows and, of RockBLOCK, a signature.
"""

import secrets
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from http import HTTPStatus
from typing import Annotated, Any, Final

from fastapi import APIRouter, Depends, Request
from pydantic import Field, SecretStr, ValidationError
from sqlalchemy.orm import Session
from starlette.requests import ClientDisconnect

from db.fault import StoreError
from db.query.station.events import add_event
from robot_link.station.gateway import cloudloop, rockblock
from robot_link.station.gateway.gateway import HeldBackError, MobileOriginated
from robot_link.station.gateway.push import PushRefusal
from server.access.dependency import Admin
from server.base.dependency import FoundationDep, service
from server.base.foundation import Foundation
from server.base.problem import FieldError, Problem, invalid, not_found, unprocessable
from server.base.secret import (
    DEFAULT_URLS,
    GATEWAY_KINDS,
    GatewayAccount,
    GatewayKind,
    SecretUnreadableError,
)
from server.base.view import Body, View
from server.satellite.gateways import GATEWAY_TITLES, Gateways

router = APIRouter(prefix="/api/gateways", tags=["gateways"])

PUSH_BYTES_MAX: Final = 8 * 1024
_STATUS_OF_REFUSAL: Final = {"malformed": 400, "signature": 403, "expired": 403, "disagrees": 403}


GatewaysDep = Annotated[Gateways, Depends(service(Gateways))]


class AccountBody(Body):
    """What changes about an account; what is left out stays as it is."""

    url: str | None = Field(default=None, max_length=500)
    """Where messages to robots go: ``https://host/path``, of DirectIP ``tcp://host:port``."""
    username: str | None = Field(default=None, max_length=200)
    """Name of the account at the gateway; empty where it has none."""
    password: SecretStr | None = Field(default=None, max_length=500)
    """Password, or Cloudloop's token; it is never shown again."""
    public_key: str | None = Field(default=None, max_length=8000)
    """PEM of the key with which RockBLOCK signs its pushes."""
    confirms: bool | None = None
    """Whether DirectIP expects a confirmation of each message of a robot."""


@dataclass(frozen=True, slots=True)
class GatewayView(View):
    """One gateway, without its secrets, and what came in from it since the station started."""

    kind: GatewayKind
    title: str
    url: str
    username: str
    has_password: bool
    has_public_key: bool
    confirms: bool
    push_url: str | None
    """What the gateway must be told to push to; treat it like a password. ``null`` of DirectIP,
    which delivers to ``port``."""
    port: int | None
    """Port on which DirectIP messages are taken now."""
    accepted: int
    duplicate: int
    refused: dict[str, int]
    """Pushes that were refused, by reason: ``bad_path``, ``too_often``, ``too_large``,
    ``no_key``, ``signature``, ``expired``, ``disagrees``, ``malformed``, ``held_back``,
    ``not_kept`` or ``address``."""
    last_at: datetime | None
    """When the last message came."""
    fault: str | None
    """Why the account cannot be read."""


@dataclass(frozen=True, slots=True)
class GatewaysView(View):
    """Every gateway that the station can speak with."""

    gateways: list[GatewayView]


@dataclass(frozen=True, slots=True)
class PushView(View):
    """The answer to a push: the message is safe."""

    is_new: bool
    """False when it had come before; it then changed nothing."""


@router.post("/rockblock/push/{secret}")
async def take_rockblock_push(
    secret: str, request: Request, gateways: GatewaysDep, foundation: FoundationDep
) -> PushView:
    """Take a robot's message that RockBLOCK pushes, as a form or as JSON, signed by its key."""
    body = await _admitted("rockblock", secret, request, gateways)
    account = await gateways.account("rockblock")
    if account is None or not account.public_key:
        sentence = "The station has no key to check it with."
        await gateways.refuse("rockblock", "no_key", sentence)
        raise Problem(403, sentence)
    try:
        message = rockblock.read_push(
            body,
            request.headers.get("content-type", ""),
            rockblock.public_key_of(account.public_key),
            foundation.clock.now(),
        )
    except PushRefusal as error:
        raise await _refused("rockblock", error, gateways) from error
    return await _taken("rockblock", message, gateways)


@router.post("/cloudloop/push/{secret}")
async def take_cloudloop_push(
    secret: str, request: Request, gateways: GatewaysDep, foundation: FoundationDep
) -> PushView:
    """Take a robot's message that Cloudloop pushes as JSON ("Lingo")."""
    body = await _admitted("cloudloop", secret, request, gateways)
    try:
        message = cloudloop.read_push(body, foundation.clock.now())
    except PushRefusal as error:
        raise await _refused("cloudloop", error, gateways) from error
    return await _taken("cloudloop", message, gateways)


@router.get("")
async def list_gateways(caller: Admin, request: Request, gateways: GatewaysDep) -> GatewaysView:
    """Return the station's gateways; a password or key is never among what is told."""
    del caller
    return GatewaysView([await _view(kind, request, gateways) for kind in GATEWAY_KINDS])


@router.put("/{kind}")
async def put_gateway(
    caller: Admin,
    kind: GatewayKind,
    body: AccountBody,
    request: Request,
    gateways: GatewaysDep,
    foundation: FoundationDep,
) -> GatewayView:
    """Enter or change the account with a gateway; it is used from the next message on."""
    account = _changed(kind, await _account(kind, gateways), body)
    await gateways.set_account(kind, account)
    at, fields = foundation.clock.now(), sorted(body.model_fields_set)
    text = f"{caller.name} changed the account with {GATEWAY_TITLES[kind]}."

    def write(session: Session) -> None:
        add_event(session, at, "gateway.changed", text, data={"gateway": kind, "fields": fields})

    await foundation.store.write(write)
    return await _view(kind, request, gateways)


async def _admitted(kind: GatewayKind, secret: str, request: Request, gateways: Gateways) -> bytes:
    """Return the body of a push that may be looked at.

    Raises:
        Problem: 404 for another path than the secret one, 429 if pushes come too often, 413 if
            this one is too large, 400 if it breaks off.
    """
    word = await gateways.push_word(kind)
    if not secrets.compare_digest(secret.encode(), word.encode()):
        await gateways.refuse(kind, "bad_path")
        raise not_found("There is nothing here.")
    if not gateways.limits[kind].admits():
        await gateways.refuse(kind, "too_often", "pushes come too often.")
        raise Problem(
            HTTPStatus.TOO_MANY_REQUESTS,
            "Pushes come too often; push this one again later.",
            headers={"Retry-After": "5"},
        )
    body = b""
    try:
        async for piece in request.stream():
            body += piece
            if len(body) > PUSH_BYTES_MAX:
                sentence = f"it is longer than {PUSH_BYTES_MAX} bytes."
                await gateways.refuse(kind, "too_large", sentence)
                raise Problem(413, f"A push has at most {PUSH_BYTES_MAX} bytes.")
    except ClientDisconnect:
        await gateways.refuse(kind, "malformed", "it broke off.")
        raise Problem(400, "The push broke off.") from None
    return body


async def _refused(kind: GatewayKind, error: PushRefusal, gateways: Gateways) -> Problem:
    await gateways.refuse(kind, error.reason, str(error))
    return Problem(_STATUS_OF_REFUSAL[error.reason], str(error))


async def _taken(kind: GatewayKind, message: MobileOriginated, gateways: Gateways) -> PushView:
    """Answer once the message is safe; a gateway that hears anything but 200 pushes it again."""
    try:
        return PushView(await gateways.take(message))
    except HeldBackError as error:
        await gateways.refuse(kind, "held_back")
        raise Problem(503, str(error), headers={"Retry-After": "60"}) from error
    except StoreError:
        await gateways.refuse(kind, "not_kept")
        raise


async def _account(kind: GatewayKind, gateways: Gateways) -> GatewayAccount:
    try:
        found = await gateways.account(kind)
    except SecretUnreadableError:
        found = None
    return found or GatewayAccount(url=DEFAULT_URLS[kind])


def _changed(kind: GatewayKind, old: GatewayAccount, body: AccountBody) -> GatewayAccount:
    """Return the account as it shall be.

    Raises:
        Problem: 422 with the fields that are wrong.
    """
    given: dict[str, Any] = body.model_dump(exclude_unset=True, exclude_none=True)
    if body.password is not None:
        given["password"] = body.password.get_secret_value()
    elif old.password and given.get("url", old.url) != old.url:
        raise _wrong("password", "enter it again: it must not go to another address unasked")
    try:
        account = GatewayAccount.model_validate(old.model_dump() | given)
    except ValidationError as error:
        raise invalid(error) from None
    if (kind == "directip") != account.url.startswith("tcp://"):
        form = "tcp://host:port" if kind == "directip" else "https://host/path"
        raise _wrong("url", f"the address of {GATEWAY_TITLES[kind]} is {form}")
    if account.public_key:
        try:
            rockblock.public_key_of(account.public_key)
        except ValueError as error:
            raise _wrong("public_key", str(error)) from error
    return account


def _wrong(name: str, message: str) -> Problem:
    return unprocessable("1 field is wrong.", [FieldError(loc=[name], msg=message)])


async def _view(kind: GatewayKind, request: Request, gateways: Gateways) -> GatewayView:
    fault = None
    try:
        account = await gateways.account(kind)
    except SecretUnreadableError as error:
        account, fault = None, str(error)
    shown = account or GatewayAccount(url=DEFAULT_URLS[kind])
    traffic = gateways.traffic[kind]
    return GatewayView(
        kind=kind,
        title=GATEWAY_TITLES[kind],
        url=shown.url,
        username=shown.username,
        has_password=bool(shown.password),
        has_public_key=bool(shown.public_key),
        confirms=shown.confirms,
        push_url=await _push_url(kind, request, gateways),
        port=gateways.directip_port if kind == "directip" else None,
        accepted=traffic.accepted,
        duplicate=traffic.duplicate,
        refused=_counts(traffic.refused),
        last_at=traffic.last_at,
        fault=fault,
    )


def _counts(refused: Mapping[str, int]) -> dict[str, int]:
    return {reason: count for reason, count in sorted(refused.items()) if count}


async def _push_url(kind: GatewayKind, request: Request, gateways: Gateways) -> str | None:
    if kind == "directip":
        return None
    foundation: Foundation = request.app.state.foundation
    base = foundation.settings.gateway_public_url or str(request.base_url)
    return f"{base.rstrip('/')}/api/gateways/{kind}/push/{await gateways.push_word(kind)}"
