"""What holds for every request, whichever route takes it."""

import asyncio
from collections.abc import Generator
from contextlib import ExitStack, contextmanager

from starlette.datastructures import MutableHeaders
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from db.actor import acting
from server.access.body import BodyReader
from server.access.caller import Caller
from server.access.deed import note_deed
from server.access.guard import Guard
from server.access.rate import settle_work, tell_rate
from server.access.stream import SignInEndedError, SignInWatch
from server.base.problem import problem_response

_HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",
    "X-Frame-Options": "SAMEORIGIN",
}


_TLS_ONLY = "max-age=31536000"


class _Download:
    """The sign-in behind an answer that is sent in pieces."""

    def __init__(self, watch: SignInWatch, request: Request) -> None:
        self._watch = watch
        self._request = request
        self._stack = ExitStack()
        self._ended: asyncio.Event | None = None

    def __enter__(self) -> None:
        pass

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> bool:
        self._stack.close()
        return isinstance(error, SignInEndedError)

    def check(self) -> None:
        """Look before each piece.

        Raises:
            SignInEndedError: If whoever asked may not have it any more.
        """
        caller: Caller | None = getattr(self._request.state, "caller", None)
        if caller is None:
            return
        if self._ended is None:
            self._ended = self._stack.enter_context(self._watch.watching(caller))
        if self._ended.is_set():
            raise SignInEndedError


@contextmanager
def _nobody_yet() -> Generator[None]:
    """Let nobody act until a request has proved for whom it is."""
    before = acting.set(None)
    try:
        yield
    finally:
        acting.reset(before)


class RequestGuard:
    """Refuses foreign host names and unsound bodies, and tells browsers to be careful.

    A download ends with the sign-in that began it: its connection breaks off, so that nobody takes
    what came for the whole.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app
        self._bodies = BodyReader()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one connection; WebSockets are checked by their own routes."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        request = Request(scope)
        scope.setdefault("state", {})
        services = request.app.state.foundation.services
        guard, download = services.get(Guard), _Download(services.get(SignInWatch), request)

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                settle_work(request)
                headers = MutableHeaders(scope=message)
                is_repeated = "Idempotent-Replayed" in headers
                await note_deed(request, message["status"], is_repeated=is_repeated)
                for name, value in _HEADERS.items():
                    headers.setdefault(name, value)
                tell_rate(request, headers)
                if guard.speaks_tls:
                    headers.setdefault("Strict-Transport-Security", _TLS_ONLY)
                if request.url.path.startswith("/api/"):
                    headers.setdefault("Cache-Control", "no-store")
            elif message.get("more_body"):
                download.check()
            await send(message)

        if guard.host_is_ours(request):
            with self._bodies.guard(request, receive, guard) as body, download, _nobody_yet():
                try:
                    await self._app(scope, body.receive, send_guarded)
                finally:
                    settle_work(request)
        else:
            refusal = problem_response(421, f"This station is not {request.url.hostname}.")
            await refusal(scope, receive, send_guarded)
