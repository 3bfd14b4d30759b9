"""To a provider of OpenID Connect and back; it never stands in the way of a password."""

import logging
import secrets
from dataclasses import dataclass
from typing import Annotated, Final
from urllib.parse import urlencode

from fastapi import APIRouter, Depends, Query, Request, Response
from fastapi.responses import RedirectResponse

from server.access.dependency import AccessDep, GuardDep
from server.access.oidc.desk import SignInDesk
from server.access.session_route import browser_of
from server.base.dependency import FoundationDep, service
from server.base.problem import Problem
from server.base.view import View

log = logging.getLogger(__name__)

router = APIRouter(tags=["session"])
SignInDeskDep = Annotated[SignInDesk, Depends(service(SignInDesk))]
_BACK: Final = "/sign-in/oidc/back"
_WAIT_S: Final = 600
Text = Annotated[str, Query(max_length=4000)]


@dataclass(frozen=True, slots=True)
class ProviderView(View):
    """The provider that one may sign in by."""

    title: str | None
    """Its name on the button; ``null`` where the station has none."""


@router.get("/api/session/provider")
async def get_provider(desk: SignInDeskDep) -> ProviderView:
    """Return whether one may sign in by a provider of OpenID Connect."""
    return ProviderView(desk.title)


@router.get("/sign-in/oidc", include_in_schema=False)
async def go_to_provider(request: Request, desk: SignInDeskDep, guard: GuardDep) -> Response:
    """Send a browser to the provider."""
    state = secrets.token_urlsafe(32)
    try:
        address = await desk.begin(state, f"{guard.public_origin(request)}{_BACK}")
    except Problem as problem:
        return _refused(problem)
    response = RedirectResponse(address, status_code=303)
    response.set_cookie(
        guard.state_cookie_name(request),
        state,
        max_age=_WAIT_S,
        path="/sign-in/oidc",
        httponly=True,
        samesite="lax",
        secure=guard.speaks_tls,
    )
    return response


@router.get(_BACK, include_in_schema=False)
async def come_back(
    request: Request,
    desk: SignInDeskDep,
    guard: GuardDep,
    access: AccessDep,
    foundation: FoundationDep,
    state: Text = "",
    code: Text = "",
    error: Text = "",
) -> Response:
    """Take a browser back from the provider, and sign its person in."""
    cookie = guard.state_cookie_name(request)
    try:
        _check_return(request.cookies.get(cookie, ""), state, code, error)
        person = await desk.finish(state, code, foundation.store, foundation.clock.now())
        signed_in = await access.sign_in_as(person, browser_of(request))
    except Problem as problem:
        return _refused(problem)
    response = RedirectResponse("/", status_code=303)
    response.delete_cookie(cookie, path="/sign-in/oidc")
    guard.set_cookies(request, response, signed_in)
    return response


def _check_return(kept: str, state: str, code: str, error: str) -> None:
    """Refuse a return that did not begin in this browser, or that the provider did not grant."""
    if not state or not secrets.compare_digest(kept.encode(), state.encode()):
        raise Problem(401, "This sign-in did not begin in this browser; begin it anew.")
    if error or not code:
        raise Problem(401, "The provider did not let you in; use your password.")


def _refused(problem: Problem) -> Response:
    """Lead back to the sign-in page, which says why."""
    log.info("a sign-in by the provider was refused: %s", problem.detail)
    return RedirectResponse(f"/#{urlencode({'refused': problem.detail})}", status_code=303)
