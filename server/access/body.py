"""Bodies of requests: read only for who may send them, in time, in size, and if they are sound.

The first read of a body asks who sends it, by the route's own demand, so that a stranger's bytes
are never kept. A JSON body is read whole and held against RFC 8259 before any route sees it: what
a route takes has no half characters and no numbers beyond all measure in it.
"""

import asyncio
from typing import Final

import msgspec
from fastapi.dependencies.models import Dependant
from starlette.requests import Request
from starlette.types import Message, Receive

from server.access.dependency import right_of
from server.access.guard import SAFE_METHODS, Guard
from server.access.role import Right
from server.base.problem import BodyProblem, FieldError, Problem, unprocessable

_MB: Final = 2**20
BODY_BYTES_MAX: Final = _MB
STRANGER_BYTES_MAX: Final = 2**16
"""Sign-in forms, and what a gateway pushes."""
FILE_BYTES_MAX: Final = {
    "/api/imports": 512 * _MB,
    "/api/imports/uploads": 2048 * _MB,
    "/api/vehicles/{key}/coefficients": 8 * _MB,
    "/api/robots/{robot}/detections": 256 * _MB,
    "/api/base-maps": 2048 * _MB,
    "/api/waters/imports": 256 * _MB,
    "/api/robots/{robot}/designs/read": 11 * _MB,
    "/api/waters/{water}/current/imports": 512 * _MB,
    "/api/logbook/attachments": 11 * _MB,
}
"""Routes that take files, by their path; anything but a form with files is kept in memory."""
FILES_AT_ONCE: Final = 4
PAUSE_MAX_S: Final = 15.0
"""Between two parts of a body."""
JSON_MAX_S: Final = 30.0
"""For the whole of a JSON body."""
_decoder = msgspec.json.Decoder()


class BodyReader:
    """Guards the bodies of one application's requests."""

    def __init__(self) -> None:
        self._files = 0

    def guard(self, request: Request, receive: Receive, guard: Guard) -> "GuardedBody":
        """Return what a route reads a request by; leave it as a context when it is answered."""
        return GuardedBody(self, request, receive, guard)

    def take_file(self) -> None:
        """Count a file that begins to come in.

        Raises:
            BodyProblem: 503 if too many come in already.
        """
        if self._files >= FILES_AT_ONCE:
            detail = "Too many files come in at once; try again soon."
            raise BodyProblem(Problem(503, detail, headers={"Retry-After": "10"}))
        self._files += 1

    def leave_file(self) -> None:
        """Count one less."""
        self._files -= 1


class GuardedBody:
    """The body of one request."""

    def __init__(
        self, reader: BodyReader, request: Request, receive: Receive, guard: Guard
    ) -> None:
        self._reader = reader
        self._request = request
        self._receive = receive
        self._guard = guard
        self._is_read = request.method in SAFE_METHODS
        self._is_begun = False
        self._has_file = False
        self._limit = 0
        self._taken = 0

    def __enter__(self) -> "GuardedBody":
        return self

    def __exit__(self, *_: object) -> None:
        if self._has_file:
            self._reader.leave_file()

    async def receive(self) -> Message:
        """Return the next part, or after the body whatever the server has to say.

        Raises:
            BodyProblem: 401 or 403 of who may not send it, 408 if it is too slow, 413 too long,
                422 no JSON.
        """
        if self._is_read:
            return await self._receive()
        if not self._is_begun:
            self._is_begun = True
            await self._begin()
        if _is_json(self._request):
            return await self._whole()
        return await self._next()

    async def _begin(self) -> None:
        route = self._request.scope.get("route")
        path = getattr(route, "path", "")
        dependant = getattr(route, "dependant", None)
        right = right_of(dependant) if isinstance(dependant, Dependant) else None
        if right is not None:
            await self._ask(right)
        has_parts = _kind(self._request) == "multipart/form-data"
        file_max = FILE_BYTES_MAX.get(path) if has_parts else None
        self._limit = STRANGER_BYTES_MAX if right is None else file_max or BODY_BYTES_MAX
        told = self._request.headers.get("content-length", "")
        if told.isascii() and told.isdecimal() and int(told[:20]) > self._limit:
            raise self._too_long()
        if right is not None and file_max is not None:
            self._reader.take_file()
            self._has_file = True

    async def _ask(self, right: Right) -> None:
        try:
            await self._guard.caller(self._request, right)
        except Problem as problem:
            raise BodyProblem(problem) from problem

    async def _next(self) -> Message:
        try:
            async with asyncio.timeout(PAUSE_MAX_S):
                message = await self._receive()
        except TimeoutError:
            raise _too_slow() from None
        self._taken += len(message.get("body", b""))
        if self._taken > self._limit:
            raise self._too_long()
        self._is_read = not message.get("more_body", False)
        return message

    async def _whole(self) -> Message:
        parts: list[bytes] = []
        try:
            async with asyncio.timeout(JSON_MAX_S):
                while not self._is_read:
                    message = await self._next()
                    if message["type"] != "http.request":
                        return message
                    parts.append(message.get("body", b""))
        except TimeoutError:
            raise _too_slow() from None
        body = b"".join(parts)
        if body:
            _check_json(body)
        return {"type": "http.request", "body": body, "more_body": False}

    def _too_long(self) -> BodyProblem:
        size = f"{self._limit // _MB} MB" if self._limit >= _MB else f"{self._limit // 1024} kB"
        return BodyProblem(Problem(413, f"This is longer than the {size} that are taken."))


def _too_slow() -> BodyProblem:
    return BodyProblem(Problem(408, "The request came too slowly; send it again."))


def _kind(request: Request) -> str:
    return request.headers.get("content-type", "").partition(";")[0].strip().lower()


def _is_json(request: Request) -> bool:
    kind = _kind(request)
    return kind == "application/json" or (
        kind.startswith("application/") and kind.endswith("+json")
    )


def _check_json(body: bytes) -> None:
    try:
        _decoder.decode(body)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        reason = str(error).removeprefix("JSON is malformed: ").partition(" - at `")[0]
    except RecursionError:
        reason = "it is nested too deeply"
    else:
        return
    wrong = [FieldError(loc=[], msg=reason)]
    raise BodyProblem(unprocessable(f"The body is not JSON: {reason}.", wrong))
