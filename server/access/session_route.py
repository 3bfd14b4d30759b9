"""Signing in and out, and finding out who one is."""

from dataclasses import dataclass, field
from datetime import datetime
from typing import Annotated

from fastapi import APIRouter, Query, Request, Response
from fastapi.responses import RedirectResponse
from pydantic import Field, SecretStr

from db.record import same
from server.access.caller import Browser, Caller
from server.access.dependency import AccessDep, GuardDep, TicketsDep, Viewer
from server.access.guard import Guard
from server.access.role import Role
from server.access.secret import PASSWORD_LENGTH_MAX, NewPassword
from server.access.stream import TICKET_S
from server.base.problem import FieldError, Problem, unprocessable
from server.base.text import NAME_LENGTH_MAX, Name
from server.base.view import Body, View

router = APIRouter(tags=["session"])


class SignInBody(Body):
    """Name and password, the token of a one-time sign-in, or the secret of a read-only link."""

    name: str | None = Field(default=None, max_length=NAME_LENGTH_MAX)
    """Name of the person."""
    password: SecretStr | None = Field(default=None, max_length=PASSWORD_LENGTH_MAX)
    """Their password."""
    token: SecretStr | None = Field(default=None, max_length=200)
    """The one-time word of an address that the command line printed."""
    link: SecretStr | None = Field(default=None, max_length=200)
    """The secret of a read-only link."""


class FirstAdminBody(Body):
    """Who sets the station up."""

    name: Name
    """Name by which the first administrator signs in."""
    password: NewPassword
    code: str = Field(max_length=100)
    """The code that the station printed at its start."""


@dataclass(frozen=True, slots=True)
class SessionView(View):
    """Who is signed in."""

    name: str
    role: Role
    rights: list[str]
    """For the station as a whole, and for all robots."""
    robots: dict[str, Role]
    """Roles for chosen robots; for each the higher of this and ``role`` holds."""
    is_link: bool
    """Whether it is a read-only link, which shows chosen robots to anybody and changes nothing."""
    csrf_token: str | None = field(repr=False)
    """Send it as ``X-CSRF-Token`` with every change; null for a bearer token, which needs none."""
    expires_at: datetime


@dataclass(frozen=True, slots=True)
class TicketView(View):
    """Opens one stream as ``?ticket=``; worth nothing once it is used or too old."""

    ticket: str = field(repr=False)
    valid_s: float


@router.get("/api/session")
async def get_session(caller: Viewer) -> SessionView:
    """Return who asks and what they may do."""
    return _view(caller)


@router.post("/api/session")
async def sign_in(
    body: SignInBody, request: Request, response: Response, access: AccessDep, guard: GuardDep
) -> SessionView:
    """Sign in by name and password, or by a one-time token; the answer sets the cookie."""
    _refuse_foreign_page(request, guard)
    if body.token is not None:
        signed_in = await access.sign_in_once(body.token.get_secret_value(), browser_of(request))
    elif body.link is not None:
        signed_in = await access.open_link(body.link.get_secret_value(), browser_of(request))
    elif body.name is not None and body.password is not None:
        password = body.password.get_secret_value()
        signed_in = await access.sign_in(
            body.name, password, browser_of(request), guard.mark_of(request)
        )
    else:
        missing = "password" if body.name is not None else "name"
        raise unprocessable("1 field is wrong.", [FieldError(loc=[missing], msg="Field required")])
    guard.set_cookies(request, response, signed_in)
    return _view(signed_in.caller)


@router.post("/api/session/first", status_code=201)
async def create_first_admin(
    body: FirstAdminBody, request: Request, response: Response, access: AccessDep, guard: GuardDep
) -> SessionView:
    """Create the first administrator with the code that the station printed, and sign in."""
    _refuse_foreign_page(request, guard)
    signed_in = await access.create_first_admin(
        body.name, body.password.get_secret_value(), body.code, browser_of(request)
    )
    guard.set_cookies(request, response, signed_in)
    return _view(signed_in.caller)


@router.post("/api/session/ticket", status_code=201)
async def issue_ticket(caller: Viewer, tickets: TicketsDep) -> TicketView:
    """Return a ticket that opens one stream, for programs that can set no header there."""
    return TicketView(tickets.issue(caller), TICKET_S)


@router.delete("/api/session", status_code=204)
async def sign_out(
    caller: Viewer, request: Request, response: Response, access: AccessDep, guard: GuardDep
) -> None:
    """End this browser's session."""
    name = guard.cookie_name(request)
    secret = request.cookies.get(name)
    if secret is not None:
        await access.sign_out(secret, caller.name)
    response.delete_cookie(name, path="/")


@router.get("/sign-in", include_in_schema=False)
async def sign_in_by_link(
    request: Request,
    access: AccessDep,
    guard: GuardDep,
    token: Annotated[str, Query(max_length=200)],
) -> Response:
    """Use a one-time sign-in up and go on to the operator app; a used link leads there too."""
    response = RedirectResponse("/", status_code=303)
    try:
        signed_in = await access.sign_in_once(token, browser_of(request))
    except Problem as problem:
        if problem.status != 401:
            raise
        return response
    guard.set_cookies(request, response, signed_in)
    return response


def browser_of(request: Request) -> Browser:
    """Return from where a request comes."""
    host = None if request.client is None else request.client.host
    return Browser(host, request.headers.get("user-agent", ""))


def _refuse_foreign_page(request: Request, guard: Guard) -> None:
    """Keep other sites from signing a browser in behind its person's back."""
    if "origin" in request.headers and not guard.origin_is_ours(request):
        raise Problem(403, "This sign-in came from a page that is not the station's.")


def _view(caller: Caller) -> SessionView:
    return same(
        SessionView,
        caller,
        rights=[right.value for right in caller.role.rights],
        robots=dict(caller.rights.by_robot),
    )
