"""The same request twice acts once."""

import contextlib
import hashlib
import json
from collections.abc import Callable, Coroutine, Generator
from datetime import UTC, datetime, timedelta
from http import HTTPStatus
from typing import Any, Final

from fastapi import Request, Response
from fastapi.routing import APIRoute

from db.claim import Claim, claimed
from db.fault import StoreError, StoreUnavailableError
from db.query.station import idempotency as query
from db.query.station.idempotency import GivenAnswer
from server.access.guard import Guard
from server.access.role import Right
from server.base.foundation import Foundation
from server.base.problem import Problem, is_refusal
from server.base.work.started import LOCATION, location_of

HEADER: Final = "Idempotency-Key"
OUTCOME_HEADER: Final = "Idempotency-Outcome"
"""``unknown`` where the first request was cut off in its middle."""
_MAKES: Final = {
    "plans": "plan",
    "plan": "plan",
    "choose": "plan",
    "continue": "plan",
    "upload": "transfer",
    "commands": "command",
    "missions": "mission",
}
"""What routes make, by the end of their paths, which their answer names alone."""
KEPT: Final = timedelta(days=1)
_KEY_LENGTH_MAX: Final = 200
Handler = Callable[[Request], Coroutine[Any, Any, Response]]


class IdempotentRoute(APIRoute):
    """A route whose POST may carry an ``Idempotency-Key``.

    The key belongs to its caller for a day. A repeated request gets the first one's answer; a
    request that was refused (4xx) leaves its key free. One that was cut off in its middle, as it
    failed, was cancelled or the station was killed, is begun anew if it had changed nothing, and
    answered by what it had made; else nobody can say what came of it, and the answer says so.
    """

    def get_route_handler(self) -> Handler:
        """Wrap the route's own handler."""
        handler = super().get_route_handler()

        async def handle(request: Request) -> Response:
            key = request.headers.get(HEADER)
            if key is None or request.method != "POST" or _storage_fails(request):
                return await handler(request)
            if not 0 < len(key) <= _KEY_LENGTH_MAX:
                raise Problem(400, f"{HEADER} has 1 to {_KEY_LENGTH_MAX} characters.")
            return await _once(request, key, handler)

        return handle


def keep_answer(request: Request, body: bytes) -> None:
    """Say what a repeated request is answered, where the first answer shows what is shown once."""
    request.state.kept_answer = body


def _storage_fails(request: Request) -> bool:
    """Tell whether no key can be kept now: the route decides then what may happen all the same."""
    foundation: Foundation = request.app.state.foundation
    return foundation.store.fault is not None


class OpenKeys:
    """The keys whose requests this station works on now."""

    def __init__(self) -> None:
        self._claims: set[tuple[str, str]] = set()

    def __contains__(self, claim: Claim) -> bool:
        """Tell whether a request with this key is being worked on."""
        return (claim.caller, claim.request_key) in self._claims

    @contextlib.contextmanager
    def held(self, claim: Claim) -> Generator[None]:
        """Count a key while its request is worked on, and let what is changed be kept with it."""
        self._claims.add((claim.caller, claim.request_key))
        before = claimed.set(claim)
        try:
            yield
        finally:
            claim.is_open = False
            claimed.reset(before)
            self._claims.discard((claim.caller, claim.request_key))


async def _once(request: Request, key: str, handler: Handler) -> Response:
    foundation: Foundation = request.app.state.foundation
    keys = foundation.services.get(OpenKeys)
    person = await foundation.services.get(Guard).caller(request, Right.VIEW)
    claim = Claim(f"{person.role} {person.name}", key)
    head = f"{request.method} {request.url.path}?{request.url.query}\n".encode()
    fingerprint = hashlib.sha256(head + await request.body()).hexdigest()
    now = datetime.now(UTC)
    is_worked_on = claim in keys
    with keys.held(claim) if not is_worked_on else contextlib.nullcontext():
        claim.is_open = False  # what follows is no change of the request
        try:
            given = await foundation.store.write(
                lambda session: query.claim(session, claim, fingerprint, now)
            )
        except StoreUnavailableError:
            return await handler(request)
        is_cut_off = given is not None and given.status is None and not is_worked_on
        if given is not None and not (is_cut_off and _may_begin_anew(given, fingerprint)):
            return _repeat(request, given, fingerprint, is_cut_off=is_cut_off)
        claim.is_open = True
        return await _answered(request, claim, handler, foundation)


def _may_begin_anew(given: GivenAnswer, fingerprint: str) -> bool:
    """Tell whether a request that was cut off changed nothing before that."""
    return given.fingerprint == fingerprint and not given.has_acted


async def _answered(
    request: Request, claim: Claim, handler: Handler, foundation: Foundation
) -> Response:
    """Return the answer of a request that is carried out, and keep it."""
    try:
        response = await handler(request)
    except BaseException as error:
        # The claim is still open: a change that is being committed now counts before the release.
        acted_too = is_refusal(error)
        with contextlib.suppress(StoreError):
            await foundation.store.write(
                lambda session: query.release(session, claim, acted_too=acted_too)
            )
        raise
    claim.is_open = False
    body: bytes = getattr(request.state, "kept_answer", bytes(response.body))
    oldest = datetime.now(UTC) - KEPT
    with contextlib.suppress(StoreError):
        await foundation.store.write(
            lambda session: (
                query.settle(session, claim, response.status_code, body),
                query.forget_before(session, oldest),
            )
        )
    return response


def _repeat(
    request: Request, given: GivenAnswer, fingerprint: str, *, is_cut_off: bool
) -> Response:
    if given.fingerprint != fingerprint:
        raise Problem(422, f"This {HEADER} was used for another request; take a new one.")
    status, body = given.status, given.body
    if status is None and not is_cut_off:
        raise Problem(
            409,
            "The first request with this key is still being worked on.",
            headers={"Retry-After": "1"},
        )
    if status is None:
        status, body = 202, _made_answer(request, given)
    headers = {"Idempotent-Replayed": "true"}
    if status == HTTPStatus.ACCEPTED:
        with contextlib.suppress(KeyError, TypeError):
            headers[LOCATION] = location_of(json.loads(body)["id"])
    return Response(body, status, headers, "application/json")


def _made_answer(request: Request, given: GivenAnswer) -> bytes:
    """Return the answer that a request would have had which the station did not live to give.

    Raises:
        Problem: 409 where nobody can say any more what came of it.
    """
    last = request.scope["route"].path.rpartition("/")[2]
    if given.made is not None and given.made.startswith(f"{_MAKES.get(last)}-"):
        return json.dumps({"id": given.made}).encode()
    headers = {OUTCOME_HEADER: "unknown"}
    made = "" if given.made is None else f"; it began {given.made}"
    if given.made is not None:
        headers[LOCATION] = location_of(given.made)
    raise Problem(
        409,
        f"The first request with this key was cut off in its middle{made}. "
        "Look what came of it before you ask again.",
        headers=headers,
    )
