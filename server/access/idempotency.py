"""The same request twice acts once."""

import contextlib
import hashlib
from collections.abc import Callable, Coroutine
from datetime import UTC, datetime, timedelta
from typing import Any, Final

from fastapi import Request, Response
from fastapi.routing import APIRoute

from db.fault import StoreError, StoreUnavailableError
from db.query.station.idempotency import GivenAnswer, claim, forget_before, release, settle
from server.access.guard import Guard
from server.access.role import Right
from server.base.foundation import Foundation
from server.base.problem import Problem, conflict

HEADER: Final = "Idempotency-Key"
KEPT: Final = timedelta(days=1)
_KEY_LENGTH_MAX: Final = 200
Handler = Callable[[Request], Coroutine[Any, Any, Response]]


class IdempotentRoute(APIRoute):
    """A route whose POST may carry an ``Idempotency-Key``.

    The key belongs to its caller for a day. A repeated request gets the first one's answer; a
    request that was refused or failed leaves its key free, for it changed nothing.
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


async def _once(request: Request, key: str, handler: Handler) -> Response:
    foundation: Foundation = request.app.state.foundation
    person = await foundation.services.get(Guard).caller(request, Right.VIEW)
    caller = f"{person.role} {person.name}"
    head = f"{request.method} {request.url.path}?{request.url.query}\n".encode()
    fingerprint = hashlib.sha256(head + await request.body()).hexdigest()
    now = datetime.now(UTC)
    try:
        given = await foundation.store.write(
            lambda session: claim(session, caller, key, fingerprint, now)
        )
    except StoreUnavailableError:
        return await handler(request)
    if given is not None:
        return _repeat(given, fingerprint)
    try:
        response = await handler(request)
    except BaseException:
        with contextlib.suppress(StoreError):
            await foundation.store.write(lambda session: release(session, caller, key))
        raise
    body: bytes = getattr(request.state, "kept_answer", bytes(response.body))
    with contextlib.suppress(StoreError):
        await foundation.store.write(
            lambda session: (
                settle(session, caller, key, response.status_code, body),
                forget_before(session, now - KEPT),
            )
        )
    return response


def _repeat(given: GivenAnswer, fingerprint: str) -> Response:
    if given.fingerprint != fingerprint:
        raise Problem(422, f"This {HEADER} was used for another request; take a new one.")
    if given.status is None:
        raise conflict("The first request with this key is still being worked on, or was cut off.")
    return Response(
        given.body,
        status_code=given.status,
        media_type="application/json",
        headers={"Idempotent-Replayed": "true"},
    )
